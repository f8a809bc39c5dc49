"""How much of the shortest possible cycle a read takes, on a pseudo-terminal with the pace of the wire.

The shortest cycle is: the request's 8 characters, 3.5 characters of silence, the answer's characters, 3.5 characters of
silence. The simulated drive answers as soon as the protocol lets it (P14.03 = 0), so what is missing to 100 % is what
the master and the operating system add. More than 100 % is possible only by cutting into the silence: the simulator
counts such requests as violations. A run's figure is that of its median cycle; a line's is the median of its runs.

usage: python -m benches.python.cycle [--only drivebus,c] [--baud 115200] [--words 1] [--runs 3] [--json]
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from benches.python.figures import markdown, show
from benches.python.masters import UNIT, Order
from benches.python.race import Result, parser, race, workers

import drivebus

RESPONSE_DELAY = "P14.03"

BAUD_RATES = [9600, 19200, 115200]
COUNTS = [1, 16]


class Cycle(NamedTuple):
    """One master at one speed and length."""

    baudrate: int
    words: int
    shortest: float
    """Seconds that no master can go below."""
    result: Result

    @property
    def share(self) -> float:
        """Of the shortest possible cycle, in percent."""
        return 100 * self.shortest / self.result.median

    def figures(self) -> dict[str, object]:
        """For JSON."""
        shares = [100 * self.shortest / run.median for run in self.result.runs]
        return {
            "baudrate": self.baudrate,
            "words": self.words,
            "master": self.result.master,
            "shortest": self.shortest,
            "median": self.result.median,
            "share": self.share,
            "shares": sorted(shares),
            "cpu": self.result.cpu,
            "violations": self.result.violations,
            "asked": self.result.asked,
        }

    def row(self) -> list[str]:
        """For a table."""
        shares = [100 * self.shortest / run.median for run in self.result.runs]
        return [
            str(self.baudrate),
            str(self.words),
            self.result.master,
            f"{self.share:.2f} %",
            f"{min(shares):.2f} … {max(shares):.2f}",
            f"{1e6 * self.result.cpu:.0f} µs",
            f"{self.result.violations} of {self.result.asked}",
        ]


HEAD = ["bit/s", "words", "master", "share of the shortest cycle", "all runs", "processor time", "silence violations"]


def seen_by(line: drivebus.sim.SimulatedLine) -> Callable[[], tuple[int, int]]:
    """Counts requests that came too early, and all."""
    return lambda: (line.silence_violations, line.requests)


def shortest(line: drivebus.SerialFormat, words: int) -> float:
    """Seconds that no master can go below."""
    return (8 + 5 + 2 * words) * line.char_time + 2 * line.t35


def main() -> None:
    """The command."""
    options = parser(__doc__, 1.0)
    options.add_argument("--baud", type=int, action="append", choices=BAUD_RATES)
    options.add_argument("--words", type=int, action="append", choices=range(1, 17))
    given = options.parse_args()
    cycles = []
    with workers(given) as masters:
        for baudrate in given.baud or BAUD_RATES:
            with drivebus.Simulator({UNIT: "gd350"}, baudrate=baudrate, parity="N", stopbits=2) as simulator:
                with drivebus.Bus(simulator.port, baudrate=baudrate, parity="N", stopbits=2) as bus:
                    bus.drive(UNIT, "gd350").write(RESPONSE_DELAY, 0, unverified=True)
                line = simulator.format
                for words in given.words or COUNTS:
                    least = shortest(line, words)
                    order = Order(
                        simulator.port, baudrate, True, line.char_time, line.t35, words,
                        warm=5, cycles=max(20, round(given.seconds / least)), limit=3 * given.seconds,
                    )  # fmt: skip
                    results = race(masters, given.runs, order, seen_by(simulator.line))
                    cycles += [Cycle(baudrate, words, least, result) for result in results]
    show(given.json, [each.figures() for each in cycles], markdown(HEAD, [each.row() for each in cycles]))


if __name__ == "__main__":
    main()
