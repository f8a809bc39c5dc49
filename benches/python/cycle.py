"""How much of the shortest possible cycle a read takes, on a pseudo-terminal with the pace of the wire.

The shortest cycle is: the request's 8 characters, 3.5 characters of silence, the answer's characters, 3.5 characters of
silence. The simulated drive answers as soon as the protocol lets it (P14.03 = 0), so what is missing to 100 % is what
the master and the operating system add. The share is that of the median; a busy machine shows in the mean.

usage: cycle.py [--seconds S] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import drivebus

UNIT, STATE, MONITOR = 1, 0x2100, 0x3000
RESPONSE_DELAY = "P14.03"

BAUD_RATES = [9600, 19200, 115200]
COUNTS = [1, 16]


class Cycle(NamedTuple):
    """One measurement."""

    baudrate: int
    words: int
    cycles: int
    shortest: float  # seconds of one cycle
    mean: float  # measured
    median: float
    violations: int

    @property
    def share(self) -> float:
        """Of the shortest possible cycle, in percent."""
        return 100 * self.shortest / self.median


def shortest(line: drivebus.SerialFormat, count: int) -> float:
    """Seconds that no master can go below."""
    characters = 8 + 5 + 2 * count
    return characters * line.char_time + 2 * line.t35


def measure(baudrate: int, count: int, seconds: float) -> Cycle:
    """Reads *count* words again and again for about *seconds*."""
    with drivebus.Simulator({UNIT: "gd350"}, baudrate=baudrate) as simulator:
        with drivebus.Bus(simulator.port, baudrate=baudrate) as bus:
            drive = bus.drive(UNIT, "gd350")
            drive.write(RESPONSE_DELAY, 0)
            least = shortest(bus.format, count)
            cycles = max(20, round(seconds / least))
            for _ in range(5):
                bus.read(UNIT, MONITOR, count)
            moments = [time.perf_counter()]
            for _ in range(cycles):
                bus.read(UNIT, MONITOR, count)
                moments.append(time.perf_counter())
        took = [end - start for start, end in pairwise(moments)]
        violations = simulator.line.silence_violations
        return Cycle(baudrate, count, cycles, least, statistics.mean(took), statistics.median(took), violations)


def table(cycles: list[Cycle]) -> str:
    """As Markdown."""
    head = [
        "| bit/s | words | shortest, ms | mean, ms | median, ms | share | silence violations |",
        "| ---: " * 7 + "|",
    ]
    rows = [
        f"| {each.baudrate} | {each.words} | {1e3 * each.shortest:.3f} | {1e3 * each.mean:.3f} "
        f"| {1e3 * each.median:.3f} | {each.share:.2f} % | {each.violations} |"
        for each in cycles
    ]
    return "\n".join(head + rows)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=3.0, help="for each measurement")
    parser.add_argument("--json", type=Path, help="write the figures there as well")
    arguments = parser.parse_args()
    cycles = [measure(baudrate, count, arguments.seconds) for baudrate in BAUD_RATES for count in COUNTS]
    print(table(cycles))
    if arguments.json:
        rows = [{**each._asdict(), "share": each.share} for each in cycles]
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
