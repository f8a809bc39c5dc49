"""In which order parameters are written, so that a drive accepts each at the moment at which it comes.

A parameter that bounds another moves first where the other is to follow it, and second where it would overtake it:
between two sound states each is written once. Pure arithmetic: nothing here asks a drive.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from drivebus.backup.intermediate_values import Step, detour, hindrance, reached

__all__ = ["Order", "Step"]


class Order:
    """Gives one step after the other, and is told what became of each.

    Args:
        now: What the drive has, of all parameters that matter here.
        wanted: What it shall have.
        pairs: Parameters of which the first is never above the second.
        last: What is written after all else, in this order, as far as bounds allow.
        may_pass: Whether a parameter may have a value on the way, where no order of single writes leads to the end.
    """

    def __init__(
        self,
        now: Mapping[str, float],
        wanted: Mapping[str, float],
        pairs: Iterable[tuple[str, str]],
        last: Sequence[str] = (),
        may_pass: Callable[[str, float], bool] = lambda _code, _value: False,
    ) -> None:
        self._now = dict(now)
        self._wanted = dict(wanted)
        self._pairs = [(low, high) for low, high in pairs if low in now and high in now and low != high]
        bounding = {code for pair in self._pairs for code in pair}
        place = {code: index for index, code in enumerate(last)}
        self._every = sorted(wanted, key=lambda code: (place.get(code, -1), code not in bounding))
        self._rest = list(self._every)
        self._may_pass = may_pass
        self._way: list[Step] = []
        self._passed: set[str] = set()

    def next(self) -> Step | None:
        """What to write now; None if nothing is left that the drive would accept."""
        step = self._on_the_way() or self._plain()
        if step is None:
            self._way = self._detour(lambda code, value: code not in self._passed and self._may_pass(code, value))
            step = self._on_the_way()
        return step

    def _plain(self) -> Step | None:
        takes = (code for code in self._rest if self.hindrance(code, self._wanted[code]) is None)
        return next((Step(code, self._wanted[code], True) for code in takes), None)

    def _on_the_way(self) -> Step | None:
        while self._way:
            step = self._way.pop(0)
            if step.code in self._rest and self.hindrance(step.code, step.value) is None:
                return step
        return None

    def wrote(self, step: Step, value: float) -> None:
        """The drive has *value* now, by *step*."""
        self._now[step.code] = value
        if step.final:
            self.leave(step.code)
        else:
            self._passed.add(step.code)

    def cannot(self, step: Step) -> None:
        """The drive would not take *step*, which was one on the way."""
        self._passed.add(step.code)
        self._way.clear()

    def leave(self, code: str) -> None:
        """*code* is not written any more."""
        if code in self._rest:
            self._rest.remove(code)

    def again(self, codes: Iterable[str]) -> None:
        """*codes*, which were left, are written after all."""
        back = {*self._rest, *codes}
        self._rest = [code for code in self._every if code in back]

    @property
    def rest(self) -> list[str]:
        """What is still to be written."""
        return list(self._rest)

    def hindrance(self, code: str, value: float) -> str | None:
        """The parameter that does not let *code* be *value* now; None if nothing hinders."""
        return hindrance(self._now, self._pairs, code, value)

    def passing(self, may_pass: Callable[[str, float], bool]) -> dict[str, list[str]]:
        """What of the rest could be written after steps on the way, each with the codes of these steps."""
        way = self._detour(may_pass)
        by = [step.code for step in way if not step.final]
        return dict.fromkeys(reached(self._now, self._left(), self._pairs, way), by)

    def _detour(self, may: Callable[[str, float], bool]) -> list[Step]:
        return detour(self._now, self._left(), self._pairs, may)

    def _left(self) -> dict[str, float]:
        return {code: self._wanted[code] for code in self._rest}
