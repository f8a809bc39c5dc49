"""What a destination has that cannot be asked: remembered here, and after a start the spool says how far it came."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing

from drivebus.sinks.intervals import Intervals, runs
from drivebus.spool import Spool, Spooled

__all__ = ["Reached"]


class Reached:
    """What one sink has of a spool.

    Args:
        spool: Where samples wait.
        sink: The name under which the spool knows how far it came.
    """

    def __init__(self, spool: Spool, sink: str) -> None:
        self._spool = spool
        self._sink = sink
        self._inside: dict[str, Intervals] | None = None

    def open(self) -> Mapping[str, Intervals]:
        """What it has, by the names of the epochs."""
        if self._inside is None:
            with closing(self._spool.reader(self._sink)) as reader:
                reached = reader.position()
                self._inside = {
                    each.epoch: Intervals([(each.first, min(each.last, reached))])
                    for each in reader.stretches()
                    if each.first <= reached
                }
        return self._inside

    def take(self, samples: Sequence[Spooled]) -> list[tuple[str, int, int]]:
        """It has *samples*, too. Returns their runs, as `give_back` takes them."""
        assert self._inside is not None
        taken = list(runs(samples))
        for epoch, first, last in taken:
            self._inside.setdefault(epoch, Intervals()).add(first, last)
        return taken

    def give_back(self, lost: Iterable[tuple[str, int, int]]) -> None:
        """It may not have these runs of numbers, by the names of their epochs."""
        assert self._inside is not None
        for epoch, first, last in lost:
            self._inside.setdefault(epoch, Intervals()).remove(first, last)
