"""Counts the instructions of the hot path under callgrind and holds them to the bounds in benches/rust/counts.txt.

A count does not depend on what else the machine does, so it can fail a build. It depends on the compiler: a bound holds
within 3 % for the compiler that it was counted with, and within 25 % for another. Only x86-64 Linux is counted.

usage: count_instructions.py [--update]      (--update writes the bounds anew)
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCE = ROOT / "benches/rust/counts.rs"
BOUNDS = ROOT / "benches/rust/counts.txt"
TARGET = ROOT / os.environ.get("CARGO_TARGET_DIR", "target")
TOOLS = ROOT / ".tools/usr"

TOLERANCE, OTHER_COMPILER = 0.03, 0.25
FAR_BELOW = 0.10
SMALL = 3
"""Instructions that no bound minds: a few per cent of a CRC are less than one."""


def valgrind() -> tuple[list[str], dict[str, str]] | None:
    """How to run it: installed, or unpacked by tools/debian_parts.sh."""
    if installed := shutil.which("valgrind"):
        return [installed], {}
    unpacked, library = TOOLS / "bin/valgrind.bin", TOOLS / "libexec/valgrind"
    return ([str(unpacked)], {"VALGRIND_LIB": str(library)}) if unpacked.exists() and library.exists() else None


def compiler() -> str:
    """What compiles it."""
    return subprocess.run(["rustc", "--version"], capture_output=True, text=True, check=True).stdout.split(" (")[0]


def count(command: list[str], settings: dict[str, str]) -> dict[str, int]:
    """Instructions of each step, by the name of its function."""
    text = SOURCE.read_text(encoding="utf-8")
    steps = re.search(r"const STEPS: usize = (\d+);", text)
    functions = re.findall(r"pub\(super\) fn (\w+)\(", text)
    assert steps
    cargo = os.environ.get("CARGO", "cargo")
    # The wheel's crate is named for its features: what the wheel was built of is not built once more.
    packages = ["-p", "drivebus-python", "-p", "drivebus-benches"]
    subprocess.run(
        [cargo, "build", "--locked", "--quiet", "--release", *packages, "--bin", "counts"], cwd=ROOT, check=True
    )
    found: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run(
            [
                *command,
                "--tool=callgrind",
                f"--callgrind-out-file={folder}/counts",
                "--toggle-collect=counts::measured::*",
                *(f"--dump-after=counts::measured::{name}" for name in functions),
                str(TARGET / "release/counts"),
            ],
            env={**os.environ, **settings},
            capture_output=True,
            text=True,
        )
        if run.returncode != 0:
            sys.exit(f"the counted program failed under valgrind:\n{run.stderr}")
        # One file for each time a function ended; of the two times the last counts, when all is warm.
        for file in sorted(Path(folder).glob("counts.*"), key=lambda file: int(file.suffix[1:])):
            dump = file.read_text(encoding="utf-8", errors="replace")
            ended, total = (
                re.search(r"dump-after=counts::measured::(\w+)", dump),
                re.search(r"^totals: (\d+)", dump, re.M),
            )
            if ended and total:
                found[ended[1]] = round(int(total[1]) / int(steps[1]))
    if missing := [name for name in functions if name not in found]:
        sys.exit(f"not counted: {', '.join(missing)}")
    return found


def bounds() -> tuple[str, dict[str, int]]:
    """The compiler of the bounds, and the bounds."""
    lines = BOUNDS.read_text(encoding="utf-8").splitlines()
    by = next(line.removeprefix("# compiler: ") for line in lines if line.startswith("# compiler: "))
    return by, {name: int(number) for name, number in (line.split() for line in lines if line and line[0] != "#")}


def write(found: dict[str, int], by: str) -> None:
    """Makes what was counted the bounds."""
    head = "# Instructions of each step of benches/rust/counts.rs. `make counts-update` writes this file.\n"
    rows = "".join(f"{name:<28} {number:>7}\n" for name, number in found.items())
    BOUNDS.write_text(f"{head}# compiler: {by}\n{rows}", encoding="utf-8")


def judge(found: dict[str, int], known: dict[str, int], tolerance: float) -> tuple[list[str], bool]:
    """A line for each, and whether all keep their bounds."""
    lines, good = [], True
    for name, number in found.items():
        bound = known.get(name)
        if bound is None:
            verdict, good = "has no bound yet: run make counts-update", False
        elif number > max(bound * (1 + tolerance), bound + SMALL):
            verdict, good = f"MORE than its bound {bound} and {tolerance:.0%}", False
        elif number < min(bound * (1 - FAR_BELOW), bound - SMALL):
            verdict = f"far below its bound {bound}: keep the gain with make counts-update"
        else:
            verdict = f"of {bound}"
        lines.append(f"{name:<28} {number:>7} {verdict}")
    for name in known.keys() - found.keys():
        lines.append(f"{name:<28} is not counted any more: run make counts-update")
        good = False
    return lines, good


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--update", action="store_true", help="make what is counted the bounds")
    update = parser.parse_args().update
    if (platform.system(), platform.machine()) != ("Linux", "x86_64"):
        print("counts: the bounds are those of x86-64 Linux; nothing is counted here")
        return
    how = valgrind()
    if how is None:
        print("counts: valgrind is missing: run `make interop-parts`, or on Debian `apt-get install valgrind`")
        sys.exit(os.environ.get("CI") == "true")
    found, by = count(*how), compiler()
    if update:
        write(found, by)
        return
    counted_with, known = bounds()
    tolerance = TOLERANCE if by == counted_with else OTHER_COMPILER
    lines, good = judge(found, known, tolerance)
    print("\n".join(lines))
    if not good:
        sys.exit(
            "counts: the hot path takes more instructions than it did. If that is the price of something: "
            "make counts-update, and say in the commit what it buys."
        )


if __name__ == "__main__":
    main()
