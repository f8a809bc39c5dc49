"""Right reads a second on a line that loses characters of its answers, beside a careful master in C on the same line.

The line is a pseudo-terminal with the pace of the wire. A share of the answers loses one character, as a line does that
loses two characters in a hundred. Both masters ask the same words, one after the other, and again up to twice; the
master in C (`careful.c`) waits so many milliseconds for what is missing.

usage: python -m benches.python.lossy [--baud 19200] [--words 1] [--seconds 10] [--runs 3] [--pause 20] [--json]
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import time
from typing import NamedTuple

from benches.python import programs
from benches.python.figures import markdown, show
from benches.python.masters import ADDRESS, UNIT

import drivebus

LOST = 0.02
"""Of the characters."""

HEAD = ["bit/s", "words", "answers that lose one", "master", "right reads a second", "all runs", "right"]


class Run(NamedTuple):
    """What one master did in one run."""

    calls: int
    right: int
    seconds: float


def ours(simulator: drivebus.Simulator, baudrate: int, words: int, seconds: float) -> Run:
    """drivebus, as it comes."""
    calls = right = 0
    with drivebus.Bus(simulator.port, baudrate=baudrate, parity="N", stopbits=2) as bus:
        wanted = None
        begun = time.monotonic()
        while time.monotonic() < begun + seconds:
            calls += 1
            try:
                came = bus.read(UNIT, ADDRESS, words)
            except drivebus.DrivebusError:
                continue
            wanted = wanted or came
            right += came == wanted
        return Run(calls, right, time.monotonic() - begun)


def careful(simulator: drivebus.Simulator, words: int, seconds: float, pause: int) -> Run:
    """The master in C."""
    silence = str(round(1e9 * simulator.format.t35))
    command = [str(programs.program("careful")), simulator.port, silence, str(ADDRESS), str(words)]
    command += [str(pause), "2", str(round(seconds))]
    return Run(**json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--baud", type=int, default=19200)
    options.add_argument("--words", type=int, action="append", choices=range(1, 17))
    options.add_argument("--seconds", type=float, default=10.0)
    options.add_argument("--runs", type=int, default=3)
    options.add_argument("--pause", type=int, default=20, help="ms that the master in C waits for more")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    rows, figures = [], []
    for words in given.words or [1, 16]:
        share = 1 - (1 - LOST) ** (5 + 2 * words)
        runs: dict[str, list[Run]] = {"drivebus": [], "careful.c": []}
        with drivebus.Simulator({UNIT: "gd350"}, baudrate=given.baud, parity="N", stopbits=2) as simulator:
            with drivebus.Bus(simulator.port, baudrate=given.baud, parity="N", stopbits=2) as bus:
                bus.drive(UNIT, "gd350").write("P14.03", 0, unverified=True)
            simulator.line.set_faults(lose_byte=share)
            for _ in range(given.runs):
                runs["drivebus"].append(ours(simulator, given.baud, words, given.seconds))
                runs["careful.c"].append(careful(simulator, words, given.seconds, given.pause))
        for master, all_runs in runs.items():
            rates = [run.right / run.seconds for run in all_runs]
            right = sum(run.right for run in all_runs) / sum(run.calls for run in all_runs)
            each = {"baudrate": given.baud, "words": words, "share": share, "master": master}
            figures.append({**each, "rates": rates, "right": right})
            spread = f"{min(rates):.1f} … {max(rates):.1f}"
            median = f"{statistics.median(rates):.1f}"
            rows.append([str(given.baud), str(words), f"{share:.0%}", master, median, spread, f"{right:.2%}"])
    show(given.json, figures, markdown(HEAD, rows))


if __name__ == "__main__":
    main()
