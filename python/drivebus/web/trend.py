"""The course of a value for a curve: as many points as a screen has, with each extreme, and gaps of what is unknown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple, TypeAlias

from drivebus.values import Value

__all__ = ["HOURS", "MOST", "Course", "Courses", "Point", "course"]

HOURS = (1, 6, 24)
"""Over so many a course can be seen."""

MOST = 2_000
"""Points of one curve, gaps aside."""

_KEPT, _FRESH = 64, 10.0
"""Courses that are kept for who comes next, and for how many seconds, for each hour of them."""

Point: TypeAlias = "tuple[float, float | None]"
"""Unix time in seconds, and a value; None: from here on nothing is known."""


def course(samples: Iterable[tuple[float, Value | None]], since: float, until: float, hold: float) -> list[Point]:
    """What *samples* between *since* and *until* say, in at most `MOST` points and as many gaps.

    The time between them is cut into pieces, and of each the lowest and the highest value stand, in their order. A
    sample that is followed by none for longer than *hold* seconds was the last before something was switched off.
    """
    pieces, found = MOST // 2, _Course()
    width = max(until - since, 1e-9) / pieces
    for at, value in sorted(samples, key=lambda sample: sample[0]):
        found.add(int((at - since) / width), at, None if value is None else float(value), hold)
    return found.end()


class _Course:
    def __init__(self) -> None:
        self._points: list[Point] = []
        self._piece = -1
        self._low: tuple[float, float] | None = None
        self._high: tuple[float, float] | None = None
        self._last: float | None = None

    def add(self, piece: int, at: float, value: float | None, hold: float) -> None:
        if self._last is not None and at - self._last > hold:
            self._gap(self._last)
        if value is None:
            self._gap(at)
            return
        self._last = at
        if piece != self._piece:
            self._flush()
            self._piece = piece
        if self._low is None or value < self._low[1]:
            self._low = (at, value)
        if self._high is None or value >= self._high[1]:
            self._high = (at, value)

    def end(self) -> list[Point]:
        self._flush()
        return self._points

    def _flush(self) -> None:
        """Puts down what the piece had."""
        both = sorted({each for each in (self._low, self._high) if each is not None})
        self._points += both
        self._low = self._high = None

    def _gap(self, at: float) -> None:
        self._flush()
        self._last = None
        if self._points and self._points[-1][1] is not None:
            self._points.append((at, None))


class Course(NamedTuple):
    """What a value did between the Unix times *since* and *until*."""

    since: float
    until: float
    points: list[Point]


class Courses:
    """Courses of the last hours: who looks at what another one has just looked at has the same. For one thread.

    Args:
        samples: Gives the samples of a drive and a value between two Unix times.
        clock: Unix time in seconds.
    """

    def __init__(
        self,
        samples: Callable[[str, str, float, float], Iterator[tuple[float, Value | None]]],
        clock: Callable[[], float],
    ) -> None:
        self._samples = samples
        self._clock = clock
        self._kept: dict[tuple[str, str, int], Course] = {}

    def of(self, drive: str, name: str, hours: int, hold: float) -> Course:
        """The course of value *name* of *drive* in the last *hours*.

        Raises:
            OSError: The samples cannot be read.
        """
        key, until = (drive, name, hours), self._clock()
        known = self._kept.pop(key, None)
        if known is None or not 0 <= until - known.until < _FRESH * hours:
            since = until - hours * 3_600.0
            known = Course(since, until, course(self._samples(drive, name, since, until), since, until, hold))
        self._kept[key] = known
        while len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return known
