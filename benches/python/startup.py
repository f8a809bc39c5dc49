"""How long a command takes from its start to its first byte on the line, beside a plain start of Python.

The line is a pseudo-terminal that nobody answers on. The runs take turns, and figures are medians. An idle machine is
needed: what else runs counts several times over, for a command starts threads and one other program.

usage: python -m benches.python.startup [--runs 30] [--json]
"""

from __future__ import annotations

import argparse
import os
import select
import statistics
import subprocess
import sys
import time
import tty
from pathlib import Path

from benches.python.figures import markdown, nanoseconds, show

PLAIN = "python -c pass"
COMMANDS = ("stop", "status")
HEAD = ["what", "from start to first byte", "times a plain start"]
LONGEST = 30.0
"""Seconds after which a command that sends nothing is given up."""


def plain() -> float:
    """Nanoseconds of a Python that does nothing, from start to end."""
    began = time.perf_counter_ns()
    subprocess.run([sys.executable, "-c", "pass"], check=True)
    return time.perf_counter_ns() - began


def to_first_byte(command: str) -> float:
    """Nanoseconds from the start of `drivebus` with *command* until its first byte is at the other end of the line."""
    own, far = os.openpty()
    try:
        tty.setraw(own)
        tty.setraw(far)
        program = Path(sys.executable).with_name("drivebus")
        called = [str(program), "--port", os.ttyname(far), "--format", "8N2", "--profile", "gd350", command]
        began = time.perf_counter_ns()
        with subprocess.Popen(called, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
            came, _, _ = select.select([own], [], [], LONGEST)
            took = time.perf_counter_ns() - began
            process.kill()
            _, told = process.communicate()
        if not came:
            raise RuntimeError(f"drivebus {command} sent nothing: {told.decode()}")
        return took
    finally:
        os.close(own)
        os.close(far)


def measure(runs: int) -> dict[str, float]:
    """Medians in nanoseconds, the plain start first."""
    taken: dict[str, list[float]] = {PLAIN: [], **{f"drivebus {command}": [] for command in COMMANDS}}
    # The first start reads everything from disk.
    for run in range(-1, runs):
        came = {PLAIN: plain(), **{f"drivebus {command}": to_first_byte(command) for command in COMMANDS}}
        if run >= 0:
            for name, took in came.items():
                taken[name].append(took)
    return {name: statistics.median(times) for name, times in taken.items()}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    figures = measure(given.runs)
    rows = [[name, nanoseconds(took), f"{took / figures[PLAIN]:.2f}"] for name, took in figures.items()]
    show(given.json, figures, markdown(HEAD, rows))


if __name__ == "__main__":
    main()
