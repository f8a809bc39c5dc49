"""Transactions a second on a pseudo-terminal without the pace of a wire, master by master: what each costs by itself.

At the other end is a slave in C that answers at once. One word is read at 115200 bit/s; who lets the silence be chosen
(drivebus, the bare master in C) keeps none. Full checks remain. Figures are medians of the runs.

usage: python -m benches.python.unpaced [--only drivebus,c,pylibmodbus] [--words 1] [--runs 3] [--json]
"""

from __future__ import annotations

from benches.python import programs
from benches.python.figures import markdown, show
from benches.python.masters import Order
from benches.python.race import Result, parser, race, workers

BAUDRATE = 115_200
HEAD = ["master", "transactions a second", "all runs", "processor time of each", "median from call to call"]


def rates(result: Result) -> list[float]:
    """Of each run, least first."""
    return sorted(run.cycles / run.seconds for run in result.runs)


def figures(result: Result) -> dict[str, object]:
    """For JSON."""
    return {
        "master": result.master,
        "rate": result.rate,
        "rates": rates(result),
        "cpu": result.cpu,
        "cpus": sorted(run.cpu / run.cycles for run in result.runs),
        "median": result.median,
    }


def row(result: Result) -> list[str]:
    """For a table."""
    return [
        result.master,
        f"{result.rate:.0f}",
        f"{rates(result)[0]:.0f} … {rates(result)[-1]:.0f}",
        f"{1e6 * result.cpu:.1f} µs",
        f"{1e6 * result.median:.1f} µs",
    ]


def main() -> None:
    """The command."""
    options = parser(__doc__, 1.0)
    options.add_argument("--words", type=int, default=1, choices=range(1, 126))
    given = options.parse_args()
    with workers(given) as masters, programs.beside("slave") as port:
        order = Order(port, BAUDRATE, False, 0.0, 0.0, given.words, warm=50, cycles=1_000_000, limit=given.seconds)
        results = race(masters, given.runs, order)
    show(given.json, [figures(each) for each in results], markdown(HEAD, [row(each) for each in results]))


if __name__ == "__main__":
    main()
