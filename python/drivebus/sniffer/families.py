"""Which family a unit is of, as far as it was said or can be heard, and what its words mean then."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping

from drivebus import checks
from drivebus.errors import DrivebusError
from drivebus.identify.codes import listed_at
from drivebus.identify.families import shipped
from drivebus.profile import Profile, profiles
from drivebus.sniffer.frames import carried, place_of, written_by
from drivebus.values import Value

__all__ = ["Families", "Given"]

Given = Mapping[int, "str | os.PathLike[str] | Profile"] | str | os.PathLike[str] | Profile | None
"""A profile for each unit, one for all of them, or None: guess."""

_LEAST = 3
"""Registers that a unit was asked for before a guess is made of them."""


class Families:
    """The families of the units on a line that others use.

    A unit that is asked for its identification code tells its family. Of one that is not, the family is guessed where
    all registers that it is asked for stand in one profile, or in some that mean the same by them; a guess says so.

    Args:
        given: A profile for each unit by its address, one for all, or None.

    Raises:
        NotAllowed: There is no such profile, or a key is not a unit.
    """

    def __init__(self, given: Given = None) -> None:
        if isinstance(given, Mapping):
            self._given = {checks.unit(unit): Profile.find(profile) for unit, profile in given.items()}
            self._all: Profile | None = None
        else:
            self._given = {}
            self._all = None if given is None else Profile.find(given)
        self._told: dict[int, Profile] = {}
        self._asked: dict[int, set[int]] = {}
        self._guessed: dict[int, Profile | None] = {}

    def of(self, unit: int) -> Profile | None:
        """The profile of *unit*, as far as it is known or guessed."""
        return self._given.get(unit) or self._all or self._told.get(unit) or self._guess(unit)

    def is_guess(self, unit: int) -> bool:
        """Whether nobody has said what *unit* is, and it has not told."""
        return unit not in self._given and self._all is None and unit not in self._told

    def hear(self, request: bytes, answer: bytes | None) -> None:
        """Takes what *request*, and its *answer* if there is one, tell of the unit."""
        unit, place = request[0], place_of(request)
        if place is None or unit == 0 or not self.is_guess(unit):
            return
        first, count = place
        for address, word in enumerate(carried(answer) or [] if answer is not None else [], first):
            names = shipped(dict.fromkeys(row["family"] for row in listed_at(address, word) if row["verified"]))
            if len(names) == 1:
                self._told[unit] = Profile.builtin(names[0])
        asked = self._asked.setdefault(unit, set())
        if not asked.issuperset(range(first, first + count)):
            asked.update(range(first, first + count))
            self._guessed.pop(unit, None)

    def values(self, request: bytes, answer: bytes | None) -> dict[str | int, Value]:
        """What *request* wrote or its *answer* carries: by names where the family is known, otherwise by addresses."""
        place, words = place_of(request), written_by(request)
        if words is None and answer is not None and answer[1] == request[1]:
            words = carried(answer)
        if place is None or not words:
            return {}
        profile, first, found = self.of(request[0]), place[0], dict[str | int, Value]()
        at = 0
        while at < len(words):
            name = None if profile is None else profile.name_at(profile.plain_address(first + at))
            if profile is None or name is None:
                found[first + at] = words[at]
                at += 1
                continue
            row = profile.describe(name)
            count = min(row.words, len(words) - at)
            try:
                found[name] = profile.compile([name]).values([words[at : at + count]])[0]
            except (DrivebusError, ValueError):
                found[first + at] = words[at]
            at += count
        return found

    def _guess(self, unit: int) -> Profile | None:
        asked = self._asked.get(unit, set())
        if unit not in self._guessed:
            able = [Profile.builtin(name) for name in profiles()] if len(asked) >= _LEAST else []
            meant = {profile.name: _meant(profile, asked) for profile in able}
            fitting = [profile for profile in able if None not in meant[profile.name]]
            # Sisters share registers: where they mean the same by all of these, it does not matter which it is.
            agree = len({meant[profile.name] for profile in fitting}) == 1
            self._guessed[unit] = fitting[0] if agree else None
        return self._guessed[unit]


def _meant(profile: Profile, addresses: Iterable[int]) -> tuple[object, ...]:
    """What *profile* means by each of *addresses*: name, unit, and what a word of 1000 is; None where it has none."""
    names = [profile.name_at(profile.plain_address(address)) for address in sorted(addresses)]
    return tuple(name and (name, profile.describe(name).unit, profile.decode(name, 1000)) for name in names)
