"""The plan of a search: which question comes next, and how what was answered changes that. Sends nothing.

Likely addresses are asked at all likely settings first. Where somebody answers, everybody is asked before the search
goes on: drives of one line are mostly set alike. At the settings of factories everybody is asked in any case.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from drivebus.checks import UNITS
from drivebus.line_search.order import LIKELY_UNITS, candidates, factory
from drivebus.line_search.settings import Settings

__all__ = ["Plan"]

_REQUEST = 8
"""Characters of a read."""


@dataclass
class _Step:
    """Those who are to be asked at *settings*."""

    settings: Settings
    units: deque[int]


class Plan:
    """What is to be asked yet, and what was.

    Args:
        first: The settings that come first.
        fixed: Whether the port has no others.
        full: Whether everybody is asked at all settings that drives can have.
        patience: Seconds that each is given at some settings.
        opening: Seconds that the line is listened to before anybody is asked at some settings.
    """

    def __init__(
        self, first: Settings, fixed: bool, full: bool, patience: Callable[[Settings], float], opening: float
    ) -> None:
        self._patience = patience
        self._opening = opening
        self._asked: dict[Settings, set[int]] = {}
        self._known: dict[int, set[int]] = {}
        self._passed: dict[Settings, str] = {}
        self._suspected: set[int] = set()
        self._behind: float | None = None
        self._fixed = fixed
        self._otherwise = LIKELY_UNITS if fixed or full else LIKELY_UNITS[:1]
        self._asked_otherwise: dict[Settings, list[int]] = {}
        self._answered_otherwise: Settings | None = None
        if fixed:
            self._steps = deque([_Step(first, deque(UNITS))])
            return
        order = [first, *candidates(first, full)]
        whole = order if full else factory()
        self._steps = deque(_Step(settings, deque(LIKELY_UNITS)) for settings in order)
        self._steps.extend(_Step(settings, deque(UNITS)) for settings in whole)

    def settings(self) -> Settings | None:
        """The settings at which somebody is to be asked next; None when the plan is done."""
        self._behind = None
        while self._steps:
            step = self._steps[0]
            if any(self._is_open(step.settings, unit) for unit in step.units):
                return step.settings
            self._steps.popleft()
        return None

    def upcoming(self) -> list[Settings]:
        """The settings at which somebody is to be asked yet, in order, each once."""
        return list(dict.fromkeys(step.settings for step in self._steps))

    def unit(self) -> int | None:
        """Who is asked next at the present settings; None when that was all there."""
        step = self._steps[0]
        while step.units:
            unit = step.units.popleft()
            if self._is_open(step.settings, unit):
                self._asked.setdefault(step.settings, set()).add(unit)
                return unit
        return None

    def answered(self, unit: int) -> None:
        """*unit* answered at the present settings: now everybody is asked there.

        It is not asked again at this speed. A stop bit more or less changes nothing, and a port may not carry parity:
        it would be found once for each format.
        """
        step = self._steps[0]
        self._known.setdefault(step.settings.baudrate, set()).add(unit)
        step.units.extend(unit for unit in UNITS if unit not in step.units)
        self._behind = None

    def otherwise(self) -> Iterator[int]:
        """Who is asked at the present settings in another protocol: nobody where anybody has answered in the usual one.

        A drive has the first address from the factory, and each question costs a time-out at each setting.
        """
        here = self._steps[0].settings
        asked = self._asked_otherwise.setdefault(here, [])
        while (unit := next(iter(self._left_otherwise(here)), None)) is not None:
            asked.append(unit)
            self._behind = None
            yield unit

    def answered_otherwise(self) -> None:
        """Somebody did at the present settings: now those that are likely are asked there, and nowhere else."""
        self._answered_otherwise = self._steps[0].settings
        self._otherwise = LIKELY_UNITS
        self._behind = None

    def _left_otherwise(self, settings: Settings) -> list[int]:
        """Those who are still to be asked at *settings* in another protocol."""
        if self._known or self._answered_otherwise not in (None, settings):
            return []
        asked = self._asked_otherwise.get(settings, ())
        return [unit for unit in self._otherwise if unit not in asked]

    def damaged(self) -> None:
        """Something came that is no answer: the speed may be right, so its other formats are next."""
        present, *rest = self._steps
        here = present.settings
        if self._fixed or here.baudrate in self._suspected:
            return
        self._suspected.add(here.baudrate)
        formats = [other for other in candidates(here, full=True) if other.baudrate == here.baudrate]
        self._steps = deque([present, *(_Step(other, deque(LIKELY_UNITS)) for other in formats), *rest])
        self._behind = None

    def passed_over(self, reason: str) -> None:
        """The port cannot have the present settings, for this *reason*."""
        self._passed[self._steps[0].settings] = reason

    def left(self) -> float:
        """Seconds until the plan is done, if nobody answers any more."""
        if not self._steps:
            return 0.0
        if self._behind is None:
            self._behind = self._time_behind()
        # What comes first is open already.
        return self._time_of(self._steps[0], set()) + self._behind

    def _time_behind(self) -> float:
        """Seconds that all but the first step take."""
        first, *behind = self._steps
        counted = {(first.settings, unit) for unit in first.units}
        seconds = 0.0
        for step in behind:
            asking = self._time_of(step, counted)
            counted |= {(step.settings, unit) for unit in step.units}
            seconds += self._opening + asking if asking else 0.0
        return seconds

    def _time_of(self, step: _Step, counted: set[tuple[Settings, int]]) -> float:
        """Seconds that those of *step* take who are still to be asked, and are not *counted* already."""
        here = step.settings
        count = sum((here, unit) not in counted and self._is_open(here, unit) for unit in step.units)
        if here not in {settings for settings, _ in counted}:
            count += len(self._left_otherwise(here))
        return count * (_REQUEST * here.timing.char_time + self._patience(here))

    def untried_otherwise(self) -> str:
        """Who was not asked in another protocol, in words."""
        last = self._otherwise[-1]
        return "another address than 1" if last == 1 else f"an address above {last}"

    def untried(self) -> list[str]:
        """What was not tried, in words: settings, and addresses at those that were."""
        told = []
        if not self._fixed:
            everything = candidates(next(iter(self._asked), factory()[0]), full=True)
            never = [each for each in everything if each not in self._asked and each not in self._passed]
            if never:
                told.append(f"{len(never)} other settings ({', '.join(_what_is_new(never, list(self._asked)))})")
        told += self._units_left()
        return [*told, *(f"{settings}: {reason}" for settings, reason in self._passed.items())]

    def _units_left(self) -> list[str]:
        """Addresses that were not asked, those of several settings together."""
        alike: dict[str, list[Settings]] = {}
        for settings, asked in self._asked.items():
            rest = [unit for unit in UNITS if unit not in asked and self._is_open(settings, unit)]
            if rest:
                alike.setdefault(f"{rest[0]} to {rest[-1]}", []).append(settings)
        return [
            f"addresses {units} at {which[0] if len(which) == 1 else f'{len(which)} of {len(self._asked)} settings'}"
            for units, which in alike.items()
        ]

    def _is_open(self, settings: Settings, unit: int) -> bool:
        """Whether *unit* was neither asked at *settings* nor found at their speed."""
        if settings in self._passed:
            return False
        return unit not in self._asked.get(settings, ()) and unit not in self._known.get(settings.baudrate, ())


def _what_is_new(never: Iterable[Settings], tried: Iterable[Settings]) -> list[str]:
    """What tells the settings that were *never* tried from those that were: speeds, formats, or each of them."""
    speeds = {each.baudrate for each in tried}
    formats = {each.format for each in tried}
    told: dict[str, None] = {}
    for each in never:
        if each.baudrate not in speeds:
            told[f"{each.baudrate} bit/s"] = None
        elif each.format not in formats:
            told[each.format] = None
        else:
            told[str(each)] = None
    return list(told)
