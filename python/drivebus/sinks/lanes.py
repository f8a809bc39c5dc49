"""What is delivered next: the present first, and beside it what had to wait, the oldest of it first."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

from drivebus.sinks.intervals import Intervals
from drivebus.spool import Reader, Spooled, Stretch

__all__ = ["Lanes"]


class Lanes:
    """Two lanes through the numbers of a spool. Everything behind `head` is the present, the rest is the backlog.

    Args:
        stretches: What the spool has. All of it that is not in is backlog.
        inside: What is in, by the names of the epochs. A spool that lost its end gives numbers again, in another
            epoch: a number alone says nothing.
    """

    def __init__(self, stretches: Sequence[Stretch], inside: Mapping[str, Intervals]) -> None:
        self.head = stretches[-1].last if stretches else 0
        """The number up to which samples were delivered as they came."""
        self._backlog: deque[tuple[int, int]] = deque()
        for epoch, first, last in stretches:
            for each in inside.get(epoch, Intervals()).missing(first, last):
                self._wait(*each)
        self._place = (self.head, self._waiting())

    @property
    def contiguous(self) -> int:
        """The number up to which nothing is missing."""
        return self._backlog[0][0] - 1 if self._backlog else self.head

    @property
    def has_backlog(self) -> bool:
        """Whether samples had to wait."""
        return bool(self._backlog)

    def behind(self, last: int) -> int:
        """How many samples are not in, where number *last* is the spool's last one. Any thread."""
        head, waiting = self._place
        return max(last - head, 0) + waiting

    def present(self, reader: Reader, last: int, limit: int) -> list[Spooled]:
        """What came, *limit* at most. Where more came, up to number *last*, its older part becomes backlog."""
        if last - self.head > limit:
            self._wait(self.head + 1, last - limit)
            self._come_to(last - limit)
        return reader.after(self.head, limit)

    def was_present(self, samples: Sequence[Spooled]) -> None:
        """What `present` gave is in."""
        self._come_to(samples[-1].seq)

    def backlog(self, reader: Reader, limit: int) -> list[Spooled]:
        """What had to wait, *limit* at most."""
        while self._backlog:
            first, last = self._backlog[0]
            found = reader.after(first - 1, limit, before=last + 1)
            if found:
                return found
            # It gave way meanwhile.
            self._backlog.popleft()
        self._come_to(self.head)
        return []

    def was_backlog(self, samples: Sequence[Spooled]) -> None:
        """What `backlog` gave is in."""
        _, last = self._backlog.popleft()
        if samples[-1].seq < last:
            self._backlog.appendleft((samples[-1].seq + 1, last))
        self._come_to(self.head)

    def _wait(self, first: int, last: int) -> None:
        if self._backlog and self._backlog[-1][1] == first - 1:
            first, _ = self._backlog.pop()
        self._backlog.append((first, last))

    def _waiting(self) -> int:
        return sum(last - first + 1 for first, last in self._backlog)

    def _come_to(self, head: int) -> None:
        self.head = head
        # In one piece, for whoever asks from another thread.
        self._place = (head, self._waiting())
