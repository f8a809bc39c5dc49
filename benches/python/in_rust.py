"""What the crates cost without Python: criterion's medians, and CRCs by tables in C from the same minute.

usage: python -m benches.python.in_rust [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys

from benches.python import programs
from benches.python.figures import markdown, nanoseconds, show

CRITERION = programs.TARGET.parent / "criterion"


def criterion() -> dict[str, float]:
    """Median nanoseconds by name."""
    shutil.rmtree(CRITERION, ignore_errors=True)
    cargo = os.environ.get("CARGO", "cargo")
    command = [cargo, "bench", "--locked", "--quiet", "-p", "drivebus-benches"]
    done = subprocess.run(command, cwd=programs.ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stdout + done.stderr)
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


def tables(medians: dict[str, float]) -> str:
    """One of CRCs, a column for each number of bytes, and one of all the rest."""
    crc: dict[str, dict[int, float]] = {}
    rest = []
    for name, took in sorted(medians.items()):
        what, _, by = name.partition("/")
        if what == "crc":
            engine, _, size = by.rpartition("/")
            crc.setdefault(engine, {})[int(size)] = took
        else:
            rest.append([what, by, nanoseconds(took)])
    sizes = sorted(crc["drivebus"])
    rows = [[engine, *(nanoseconds(took[size]) for size in sizes)] for engine, took in crc.items()]
    head = ["CRC of", *(f"{size} bytes" for size in sizes)]
    return f"{markdown(head, rows)}\n\n{markdown(['what', 'by', 'median'], rest)}"


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    before = in_c()
    medians = criterion()
    # The machine's mood may change meanwhile: C has the better of before and after.
    medians |= {name: min(took, before[name]) for name, took in in_c().items()}
    show(given.json, medians, tables(medians))


if __name__ == "__main__":
    main()
