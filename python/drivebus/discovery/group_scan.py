"""The order of the questions: which parameters of one group there are, in few reads, and none of them guessed.

Knows nothing of drives and lines. A number counts as there when a read that covered it was answered, and as not there
when it was refused by itself. What a refused read of several numbers says is only that one of them is not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from drivebus.backup.unread import Unread

__all__ = ["LAST", "Walk"]

LAST = 99
"""The greatest number of a parameter in its group: codes have two digits for it."""


@dataclass(slots=True)
class Walk:
    """One group, from its first number to its last.

    In a run of parameters as many are asked for as one read takes. Where such a read is refused, it is cut in two until
    the end of the run is found. Behind it the numbers are asked for one by one, until the next run begins.

    Attributes:
        most: How many words one read takes.
        found: The word of each number that is there.
        refused: Numbers that were refused by themselves, and how.
    """

    most: int
    found: dict[int, int] = field(default_factory=dict)
    refused: dict[int, Unread] = field(default_factory=dict)
    _next: int = 0
    _count: int = 0
    _end: int | None = None

    def __post_init__(self) -> None:
        self._count = self.most

    def ask(self) -> tuple[int, int] | None:
        """The first number of the next read, and how many; None when the group is done."""
        if self._next > LAST:
            return None
        return self._next, min(self._count, LAST + 1 - self._next)

    def answered(self, words: Sequence[int]) -> None:
        """Takes what the read brought."""
        self.found.update(enumerate(words, self._next))
        self._next += len(words)
        # The whole of what is left before a known end was refused before: half of it may be answered.
        self._count = self.most if self._end is None else max(1, (self._end - self._next) // 2)

    def was_refused(self, count: int, how: Unread) -> None:
        """Takes that the drive refused the read of *count* words, and *how*."""
        if count > 1:
            # One of these is not there; the run ends before.
            self._end, self._count = self._next + count, count // 2
            return
        self.refused[self._next] = how
        self._next, self._count, self._end = self._next + 1, 1, None
