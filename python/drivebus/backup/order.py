"""In which order parameters are written, so that a drive accepts each at the moment at which it comes.

A parameter that bounds another moves first where the other is to follow it, and second where it would overtake it.
Where neither may move, one of them takes an intermediate step. Pure arithmetic: nothing here asks a drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

__all__ = ["Order", "Step"]


class Step(NamedTuple):
    """One write: *value* in engineering units, on the way only if not *final*."""

    code: str
    value: float
    final: bool


class Order:
    """Gives one step after the other, and is told what became of each.

    Args:
        now: What the drive has, of all parameters that matter here.
        wanted: What it shall have.
        pairs: Parameters of which the first is never above the second.
        last: What is written after all else, in this order, as far as bounds allow.
    """

    def __init__(
        self,
        now: Mapping[str, float],
        wanted: Mapping[str, float],
        pairs: Iterable[tuple[str, str]],
        last: Sequence[str] = (),
    ) -> None:
        self._now = dict(now)
        self._wanted = dict(wanted)
        self._pairs = [(low, high) for low, high in pairs if low in now and high in now and low != high]
        bounding = {code for pair in self._pairs for code in pair}
        place = {code: index for index, code in enumerate(last)}
        self._every = sorted(wanted, key=lambda code: (place.get(code, -1), code not in bounding))
        self._rest = list(self._every)
        self._stepped: set[str] = set()

    def next(self) -> Step | None:
        """What to write now; None if nothing is left that the drive would accept."""
        for code in self._rest:
            if self.hindrance(code, self._wanted[code]) is None:
                return Step(code, self._wanted[code], True)
        for code in self._rest:
            value = self._between(code)
            if code not in self._stepped and value != self._now[code] and self._helps(code, value):
                return Step(code, value, False)
        return None

    def wrote(self, step: Step, value: float) -> None:
        """The drive has *value* now, by *step*."""
        self._now[step.code] = value
        if step.final:
            self.leave(step.code)
        else:
            self._stepped.add(step.code)

    def leave(self, code: str) -> None:
        """*code* is not written any more."""
        if code in self._rest:
            self._rest.remove(code)

    def again(self, codes: Iterable[str]) -> None:
        """*codes*, which were left, are written after all."""
        back = {*self._rest, *codes}
        self._rest = [code for code in self._every if code in back]

    def cannot(self, step: Step) -> None:
        """The drive cannot have the value of *step*, which was one on the way."""
        self._stepped.add(step.code)

    @property
    def rest(self) -> list[str]:
        """What is still to be written."""
        return list(self._rest)

    def hindrance(self, code: str, value: float) -> str | None:
        """The parameter that does not let *code* be *value* now; None if nothing hinders."""
        return self._hindrance(self._now, code, value)

    def _hindrance(self, now: Mapping[str, float], code: str, value: float) -> str | None:
        for low, high in self._pairs:
            if (code == high and value < now[low]) or (code == low and value > now[high]):
                return low if code == high else high
        return None

    def _between(self, code: str) -> float:
        """The value nearest to the wanted one that the drive would accept now; the present one where there is none."""
        lowest = max((self._now[low] for low, high in self._pairs if high == code), default=-math.inf)
        highest = min((self._now[high] for low, high in self._pairs if low == code), default=math.inf)
        nearest = min(max(self._wanted[code], lowest), highest)
        return nearest if self.hindrance(code, nearest) is None else self._now[code]

    def _helps(self, code: str, value: float) -> bool:
        """Whether something else could be written for good once *code* is *value*: no step is taken for nothing."""
        then = {**self._now, code: value}
        others = (other for other in self._rest if other != code)
        return any(self._hindrance(then, other, self._wanted[other]) is None for other in others)
