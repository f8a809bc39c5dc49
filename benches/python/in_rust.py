"""What the crates cost without Python: criterion's medians, and CRCs by tables in C from the same minute.

usage: python -m benches.python.in_rust [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
from pathlib import Path

from benches.python import programs
from benches.python.figures import markdown, nanoseconds, show

CRITERION = programs.TARGET.parent / "criterion"


def criterion() -> dict[str, float]:
    """Median nanoseconds by name."""
    shutil.rmtree(CRITERION, ignore_errors=True)
    cargo = os.environ.get("CARGO", "cargo")
    subprocess.run(
        [cargo, "bench", "--locked", "--quiet", "-p", "drivebus-benches"],
        cwd=programs.ROOT,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    medians = {}
    for path in CRITERION.glob("**/new/benchmark.json"):
        name = json.loads(path.read_text(encoding="utf-8"))["full_id"]
        estimates = json.loads((path.parent / "estimates.json").read_text(encoding="utf-8"))
        medians[name] = float(estimates["median"]["point_estimate"])
    return medians


def in_c() -> dict[str, float]:
    """The same of the tables in C."""
    done = subprocess.run([programs.program("crc_tables")], check=True, capture_output=True, text=True)
    sizes: dict[str, dict[str, float]] = json.loads(done.stdout)
    return {f"crc/{method}/{size}": took for size, methods in sizes.items() for method, took in methods.items()}


def order(name: str) -> list[tuple[int, str]]:
    """Sorts CRCs by number of bytes, everything else by name."""
    what, *rest = name.split("/")
    number = int(rest[-1]) if rest and rest[-1].isdigit() else 0
    return [(0, what), (number, ""), (0, "/".join(rest))]


def label(name: str) -> tuple[str, str]:
    """Of `crc/drivebus/8`: what is done, and by whom."""
    parts = name.split("/")
    if parts[0] == "crc":
        return f"CRC of {Path(name).name} bytes", parts[1]
    return parts[0], "/".join(parts[1:])


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    before = in_c()
    medians = criterion()
    # The machine's mood may change meanwhile: C has the better of before and after.
    medians |= {name: min(took, before[name]) for name, took in in_c().items()}
    rows = [[*label(name), nanoseconds(medians[name])] for name in sorted(medians, key=order)]
    show(given.json, medians, markdown(["what", "by", "median"], rows))


if __name__ == "__main__":
    main()
