"""Masters on one line, turn by turn, several runs each: what `cycle` and `unpaced` have in common."""

from __future__ import annotations

import argparse
import os
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from benches.python import programs
from benches.python.masters import NAMES, Absent, Order, Outcome, Worker


class Result(NamedTuple):
    """What one master did in all its runs."""

    master: str
    runs: list[Outcome]
    violations: int
    """Requests that came before the silence was over."""
    asked: int

    @property
    def median(self) -> float:
        """Seconds from call to call: the median of each run, and of these the median."""
        return statistics.median(run.median for run in self.runs)

    @property
    def rate(self) -> float:
        """Transactions a second, median of the runs."""
        return statistics.median(run.cycles / run.seconds for run in self.runs)

    @property
    def cpu(self) -> float:
        """Processor seconds for a transaction, median of the runs."""
        return statistics.median(run.cpu / run.cycles for run in self.runs)


def parser(about: str | None, seconds: float) -> argparse.ArgumentParser:
    """The options that all have."""
    options = argparse.ArgumentParser(description=(about or "").partition("\n")[0])
    options.add_argument("--only", type=names, default=NAMES, help=f"masters, of {','.join(NAMES)}")
    options.add_argument("--runs", type=int, default=5)
    options.add_argument("--seconds", type=float, default=seconds, help="of each run, at least 20 reads")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    options.add_argument("--idle", action="store_true", help="let the processor idle between, as it will")
    options.add_argument("--realtime", action="store_true", help="on a busy machine: all that is measured goes first")
    return options


def names(text: str) -> list[str]:
    """Masters by name, comma between."""
    wanted = text.split(",")
    for name in wanted:
        if name not in NAMES:
            raise argparse.ArgumentTypeError(f"{name} is none of {', '.join(NAMES)}")
    return wanted


@contextmanager
def workers(given: argparse.Namespace) -> Iterator[list[Worker]]:
    """The masters that are here, and a processor that does not idle; who is not here is named on standard error."""
    if given.realtime:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(10))  # and so everything that is started from here
    here = []
    for name in given.only:
        try:
            here.append(Worker(name))
        except Absent as reason:
            print(f"left out: {reason}", file=sys.stderr)
    try:
        if given.idle:
            yield here
        else:
            with programs.beside("awake"):
                yield here
    finally:
        for worker in here:
            worker.close()


def race(
    masters: Sequence[Worker], runs: int, order: Order, seen: Callable[[], tuple[int, int]] = lambda: (0, 0)
) -> list[Result]:
    """All of them, in turns, so that a busy moment of the machine meets each alike.

    *seen* counts, from the line, the requests that came before the silence was over, and all requests.
    """
    results = {worker.name: Result(worker.name, [], 0, 0) for worker in masters}
    for _ in range(runs):
        for worker in masters:
            violations, asked = seen()
            outcome = worker.run(order)
            violations, asked = seen()[0] - violations, seen()[1] - asked
            result = results[worker.name]
            results[worker.name] = result._replace(
                runs=[*result.runs, outcome], violations=result.violations + violations, asked=result.asked + asked
            )
    return list(results.values())
