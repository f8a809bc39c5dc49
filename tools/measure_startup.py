"""Measures starts, side by side: the bare interpreter, imports, `drivebus --version`, a stop until it is on the wire.

`measure_startup.py --times 20`. The stop goes to a simulated GD350 behind a pseudo-terminal, and counts from the start
of the process until the drive has taken the word. Figures by the wall clock are for people: no test judges by them.
`python -X importtime -m drivebus --version` tells what takes long, `tests/python/test_startup.py` what may be loaded.
"""

from __future__ import annotations

import argparse
import compileall
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import drivebus

COMMAND = shutil.which("drivebus", path=str(Path(sys.executable).parent))
STOP = ["--profile", "gd350", "stop"]


def took(*words: str) -> float:
    """Seconds that the program of *words* takes."""
    began = time.perf_counter()
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began


def python(program: str) -> float:
    """Seconds that the interpreter takes for *program*."""
    return took(sys.executable, "-c", program)


def command(*words: str) -> float:
    """Seconds that the command takes, with the cost of its script."""
    return took(*([COMMAND] if COMMAND else [sys.executable, "-m", "drivebus"]), *words)


def stop() -> float:
    """Seconds from the start of `drivebus stop` until the drive has taken it."""
    with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator:
        began = simulator.now()
        command("--port", simulator.port, *STOP)
        return simulator.drive(1).writes()[0][0] - began


STARTS: dict[str, Callable[[], float]] = {
    "python -c pass": lambda: python("pass"),
    "import click": lambda: python("import click"),
    "import drivebus": lambda: python("import drivebus"),
    "from drivebus import Bus": lambda: python("from drivebus import Bus"),
    "drivebus --version": lambda: command("--version"),
    "drivebus --help": lambda: command("--help"),
    "drivebus stop, on the wire": stop,
}


def main() -> None:
    """Measures, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    times = parser.parse_args().times
    # As after an installation, also where this interpreter is told to write none.
    compileall.compile_dir(Path(drivebus.__file__).parent, quiet=2)
    # In turns: what else the machine does meets them all.
    figures: dict[str, list[float]] = {name: [] for name in STARTS}
    for _ in range(times):
        for name, start in STARTS.items():
            figures[name].append(start())
    bare = statistics.median(figures["python -c pass"])
    print(f"{'':28} {'median':>9} {'least':>9}   times `python -c pass`")
    for name, seconds in figures.items():
        median = statistics.median(seconds)
        print(f"{name:28} {1e3 * median:6.0f} ms {1e3 * min(seconds):6.0f} ms   {median / bare:.1f}")


if __name__ == "__main__":
    main()
