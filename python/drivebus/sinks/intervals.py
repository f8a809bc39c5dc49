"""Which numbers of an epoch are in, as intervals that grow together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from drivebus.spool import Spooled

__all__ = ["Change", "Intervals", "runs"]


class Change(NamedTuple):
    """What an added interval changes.

    Attributes:
        gone: The intervals that it has grown together with.
        come: The one that stands there now.
    """

    gone: tuple[tuple[int, int], ...]
    come: tuple[int, int]


class Intervals:
    """Intervals of whole numbers, first and last, both of them in."""

    def __init__(self, intervals: Iterable[tuple[int, int]] = ()) -> None:
        self._all = sorted(intervals)

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return iter(self._all)

    def add(self, first: int, last: int) -> Change:
        """All from *first* to *last* are in."""
        gone = tuple(each for each in self._all if each[0] <= last + 1 and each[1] >= first - 1)
        come = (min([first, *(each[0] for each in gone)]), max([last, *(each[1] for each in gone)]))
        self._all = sorted([*(each for each in self._all if each not in gone), come])
        return Change(gone, come)

    def remove(self, first: int, last: int) -> None:
        """None from *first* to *last* is in."""
        left = [(begin, min(end, first - 1)) for begin, end in self._all]
        right = [(max(begin, last + 1), end) for begin, end in self._all]
        # One that reaches beyond on both sides leaves two, and one that is clear of it is the same twice.
        self._all = sorted({(begin, end) for begin, end in left + right if begin <= end})

    def missing(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        """The intervals between *first* and *last* that are not in."""
        for begin, end in self._all:
            if begin > last:
                break
            if first < begin:
                yield first, begin - 1
            first = max(first, end + 1)
        if first <= last:
            yield first, last


def runs(samples: Sequence[Spooled]) -> Iterator[tuple[str, int, int]]:
    """The epochs and numbers of *samples*, which are in their order, as runs without a gap."""
    begin = before = samples[0]
    for sample in samples[1:]:
        if sample.epoch != before.epoch or sample.seq != before.seq + 1:
            yield begin.epoch, begin.seq, before.seq
            begin = sample
        before = sample
    yield begin.epoch, begin.seq, before.seq
