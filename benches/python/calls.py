"""What calls from Python cost that need no line, beside other packages: runs `bench_*.py` under pytest-benchmark.

usage: python -m benches.python.calls [--json]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from benches.python.figures import markdown, nanoseconds, show

OPTIONS = [
    *("benches/python", "-o", "python_files=bench_*.py", "-p", "no:cacheprovider", "--quiet"),
    *("--benchmark-disable-gc", "--benchmark-warmup=on", "--benchmark-max-time=0.5"),
]


class Group(defaultdict[str, float]):
    """Median nanoseconds of one kind of call, by engine."""

    def __init__(self) -> None:
        super().__init__(float)


def measure() -> dict[str, Group]:
    """Runs them all."""
    groups: dict[str, Group] = defaultdict(Group)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "calls.json"
        command = [sys.executable, "-m", "pytest", *OPTIONS, f"--benchmark-json={file}"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(done.stdout + done.stderr)
        for each in json.loads(file.read_text(encoding="utf-8"))["benchmarks"]:
            groups[each["group"]][each["params"]["engine"]] = 1e9 * each["stats"]["median"]
    return groups


def rows(groups: dict[str, Group]) -> list[list[str]]:
    """For a table: the fastest first."""
    lines = []
    for what, engines in groups.items():
        for engine, median in sorted(engines.items(), key=lambda item: item[1]):
            ratio = "" if engine == "drivebus" else f"{median / engines['drivebus']:.2f} x"
            lines.append([what, engine, nanoseconds(median), ratio])
    return lines


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    groups = measure()
    head = ["what", "engine", "median", "its time beside drivebus's"]
    show(given.json, groups, markdown(head, rows(groups)))


if __name__ == "__main__":
    main()
