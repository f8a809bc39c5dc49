"""The rows on the simulator: its faults, one kind at a time and all at once, and the time between frames.

Here the line keeps real character times at the speed asked for, the unit is a simulated GD350, and what a read should
have brought is what the drive says of its own register.
"""

from __future__ import annotations

import contextlib
import statistics
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count, pairwise
from pathlib import Path

from drivebus.errors import DrivebusError
from drivebus.sim import FAULT_KINDS, Simulator

from .child import Child, Outcome
from .slave import UNIT
from .verdict import HUNG, PATIENCE, RIGHT, WRONG, Verdict, judged, pace

RATE = 0.02  # of all answers, each kind
SEED = 20
READS, READS_OF_ALL = 300, 1000
GIVEN_UP = 25  # reads in a row that were not right, for PATIENCE at least: the library is not asked further
BAUD = 115_200
ALL, UNPLUG = "all", "unplug"
# Chance pulls out only what is in this process: here the port is unplugged by hand, before every 50th read.
KINDS = (*(kind for kind in FAULT_KINDS if kind != UNPLUG), UNPLUG, ALL)
TIMEOUT = 0.2  # seconds that the libraries wait
LATE = 0.25  # seconds at least, twice that at most
OVERTAKEN = (0.22, 0.8)  # seconds at least and at most
AWAY = 0.25  # seconds without the port
PARAMETERS = range(0x2000)  # below commands and states: they stay as they are

MONITOR, WORDS, TIMES = 0x3000, 10, 60  # of the row about the time between frames
SPEEDS = (9_600, 19_200, 115_200)


Read = Callable[[int, list[int]], Outcome]
"""Reads as many registers as there are values, which are what it should bring."""


@dataclass
class Tally:
    """How the reads of one row ended."""

    ends: Counter[str] = field(default_factory=Counter)
    errors: Counter[str] = field(default_factory=Counter)
    hits: int = 0  # answers that were spoilt
    slowest: float = 0.0  # seconds from the end of a read that was not right to the end of the next right one
    recovered: bool = True

    def add(self, verdict: Verdict) -> None:
        self.ends[verdict.kind] += 1
        if verdict.kind not in (RIGHT, WRONG):
            self.errors[verdict.detail] += 1

    @property
    def asked(self) -> int:
        return self.ends.total()


@contextlib.contextmanager
def line(baudrate: int) -> Iterator[tuple[Simulator, Path]]:
    """A simulated GD350 behind a pseudo-terminal that keeps its link when it is plugged in again."""
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "port"
        with Simulator({UNIT: "gd350"}, baudrate=baudrate, parity="N", seed=SEED, link=str(link)) as simulator:
            yield simulator, link


def different_pairs(simulator: Simulator, unit: int = UNIT) -> dict[int, list[int]]:
    """Where two of the drive's parameters stand side by side, and their values, no pair twice.

    All reads are of the same length, so that the answer to another question has the shape of the right one, and shows.
    """
    drive = simulator.drive(unit)
    words: dict[int, int] = {}
    for address in PARAMETERS:
        with contextlib.suppress(DrivebusError):
            words[address] = drive.register(address)
    pairs = {(words[at], words[at + 1]): at for at in words if at + 1 in words}
    return {at: list(pair) for pair, at in pairs.items() if any(pair)}


def spoilt(library: str, kind: str, reads: int | None = None) -> Tally:
    """One library with its defaults on a line with one kind of fault, or all of them."""
    with line(BAUD) as (simulator, port), Child(library) as child:
        opened = child.open(port, baudrate=BAUD, retries=None)
        if not opened.returned:
            return Tally(errors=Counter([f"open: {opened.error}"]))
        return spoilt_reads(simulator, lambda address, values: child.read(address, len(values)), kind, reads)


def spoilt_reads(
    simulator: Simulator, read: Read, kind: str, reads: int | None = None, timeout: float = TIMEOUT
) -> Tally:
    """How the reads of whoever reads the line of *simulator* end, with one kind of fault on it, or all of them."""
    if reads is None:
        reads = READS_OF_ALL if kind == ALL else READS
    tally = Tally()
    pairs = list(different_pairs(simulator).items())
    read(*pairs[0])
    if kind == UNPLUG:
        _reads(read, pairs, reads, tally, lambda number: _unplug(simulator, number, tally))
    else:
        spoil(simulator, kind, timeout)
        _reads(read, pairs, reads, tally)
        tally.hits = sum(simulator.line.fault_counts().values())
    return tally


def spoil(simulator: Simulator, kind: str, timeout: float) -> None:
    """Puts one kind of fault on the line, or all of them. What is late is late for a *timeout* of so many seconds."""
    longer, (low, high) = timeout / TIMEOUT, OVERTAKEN
    simulator.line.set_times(late=LATE * longer, overtaken=(low * longer, high * longer))
    simulator.line.set_faults(**{kind: RATE})


def _unplug(simulator: Simulator, number: int, tally: Tally) -> None:
    """Pulls the adapter out before every 50th read, and has it put back after a while."""
    if number and number % round(1 / RATE) == 0:
        simulator.line.unplug()
        tally.hits += 1
        threading.Timer(AWAY, simulator.line.replug).start()


def _reads(
    read: Read,
    pairs: Sequence[tuple[int, list[int]]],
    reads: int,
    tally: Tally,
    before: Callable[[int], None] = lambda _: None,
) -> None:
    """The reads of a row; and more, which do not count, where its last one failed: that alone tells of no end."""
    failed_at: float | None = None
    in_a_row = 0
    for number in count():
        if number < reads:
            before(number)
        elif failed_at is None:
            return
        asked = time.monotonic()
        address, values = pairs[number % len(pairs)]
        verdict = judged(read(address, values), values)
        now = time.monotonic()
        if number < reads:
            tally.add(verdict)
        if verdict.kind == RIGHT:
            if failed_at is not None:
                tally.slowest = max(tally.slowest, now - failed_at)
            failed_at, in_a_row = None, 0
            continue
        failed_at = now if failed_at is None else failed_at
        in_a_row += 1
        if verdict.kind == HUNG or (in_a_row >= GIVEN_UP and now - failed_at >= PATIENCE):
            tally.recovered = False
            return
        pace(asked, in_a_row)


@dataclass(frozen=True)
class Pace:
    """What a library leaves between the last bit of an answer and the first of its next request."""

    idle: float | None  # seconds, median
    too_early: int  # requests that came before 3.5 characters were over
    error: str = ""


def idle(library: str, baudrate: int) -> Pace:
    """Ten registers, again and again, from one loop in the library's own process."""
    with line(baudrate) as (simulator, port), Child(library) as child:
        opened = child.open(port, baudrate=baudrate, timeout=0.5)
        if not opened.returned:
            return Pace(None, 0, opened.error or HUNG)
        child.order("repeat", [MONITOR, WORDS, 5])
        before = len(simulator.line.trace())
        done = child.order("repeat", [MONITOR, WORDS, TIMES], bound=60)
        if not done.returned:
            return Pace(None, 0, done.error or HUNG)
        trace = simulator.line.trace()[before:]
        gaps = [
            began - (answered + len(answer) * simulator.format.char_time)
            for (answered, who, answer), (began, next_, _) in pairwise(trace)
            if (who, next_) == ("unit", "master")
        ]
        return Pace(statistics.median(gaps), sum(gap < simulator.format.t35 for gap in gaps))
