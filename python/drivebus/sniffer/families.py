"""Which family a unit is of, as far as it was said or can be heard, and what its words mean then."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping

from drivebus import checks
from drivebus.errors import DrivebusError
from drivebus.identify.codes import listed_at
from drivebus.identify.families import shipped
from drivebus.line.addresses import EVERYBODY
from drivebus.profile import Profile, profiles
from drivebus.sniffer.frames import carried, place_of, written_by
from drivebus.values import Value

__all__ = ["Families", "Given"]

Given = Mapping[int, "str | os.PathLike[str] | Profile"] | str | os.PathLike[str] | Profile | None
"""A profile for each unit, one for all of them, or None: guess."""

_LEAST = 3
"""Registers that a unit has answered with before a guess is made of them."""
_REQUESTS = 2
"""Different requests that it answered by then: one read of a few words says nothing of a family."""
_MANY = 6
"""Registers that say as much, where one family alone has all of them."""
_NO_SUCH_ADDRESS = 0x02
_MOST_WORDS = 16
"""Different words of one register that are held against a family."""


class Families:
    """The families of the units on a line that others use.

    A unit that is asked for its identification code tells its family. Of one that is not, the family is guessed, from
    several requests that it answered: any that has all registers that it answers with, can have the values that are in
    them, and has none that the unit says it has not. Where several are left, names are those on which
    they agree, so a guess stays where the next request brings a register on which they differ. A family that is told by
    what its units answer is guessed only when they were asked for that, or where many registers fit nobody else: makers
    use the same addresses. Where no family has all of them any more, it is taken back; see `withdrawn`.

    Args:
        given: A profile for each unit by its address, one for all, or None.

    Raises:
        NotAllowed: There is no such profile, or a key is not a unit.
    """

    def __init__(self, given: Given = None) -> None:
        if isinstance(given, Mapping):
            self._given = {_unit(unit): Profile.find(profile) for unit, profile in given.items()}
            self._all: Profile | None = None
        else:
            self._given = {}
            self._all = None if given is None else Profile.find(given)
        self._told: dict[int, Profile] = {}
        self._apart: set[int] = set()
        self._asked: dict[int, set[int]] = {}
        self._requests: dict[int, set[tuple[int, int, int]]] = {}
        self._words: dict[int, dict[int, set[tuple[int, bool]]]] = {}
        self._refused: dict[int, set[tuple[int, int]]] = {}
        self._fitting: dict[int, tuple[Profile, ...]] = {}
        self._likely: dict[int, tuple[Profile, ...]] = {}
        self._agreed: dict[tuple[int, int, int], bool] = {}
        self._withdrawn: list[tuple[int, str, int]] = []

    def of(self, unit: int, request: bytes | None = None) -> Profile | None:
        """The profile of *unit*, as far as it is known or guessed; a guess only where it tells what *request* means."""
        known = self._given.get(unit) or self._all or self._told.get(unit)
        if known is not None or unit in self._apart:
            return known
        fitting = self._likely.get(unit, ())
        if not fitting or (request is not None and not self._agree(fitting, request)):
            return None
        return fitting[0]

    def is_guess(self, unit: int) -> bool:
        """Whether nobody has said what *unit* is, and it has not told."""
        return unit not in self._given and self._all is None and unit not in self._told

    def hear(self, request: bytes, answer: bytes | None) -> None:
        """Takes what *request*, and its *answer* if there is one, tell of the unit."""
        unit, place = request[0], place_of(request)
        if place is None or unit == 0 or not self.is_guess(unit):
            return
        first, count = place
        for address, word in enumerate(carried(answer, request) or [] if answer is not None else [], first):
            names = shipped(dict.fromkeys(row.family for row in listed_at(address, word) if row.verified))
            if len(names) == 1:
                self._told[unit] = Profile.builtin(names[0])
        if answer is None:
            return
        new = set(range(first, first + count))
        if answer[1] & 0x80:
            # What it refuses it may not have, and of an address it says so.
            if answer[2] != _NO_SUCH_ADDRESS or (first, count) in self._refused.setdefault(unit, set()):
                return
            self._refused[unit].add((first, count))
            self._guess(unit, new)
            return
        asked, requests = self._asked.setdefault(unit, set()), self._requests.setdefault(unit, set())
        words, is_written = written_by(request), True
        if words is None:
            words, is_written = carried(answer, request) or [], False
        seen = self._words.setdefault(unit, {})
        said = {
            (address, word)
            for address, word in enumerate(words[:count], first)
            if word and (word, is_written) not in seen.setdefault(address, set())
        }
        for address, word in said:
            # So many different words of one register say what can be said.
            if len(seen[address]) < _MOST_WORDS:
                seen[address].add((word, is_written))
        if said or new - asked or (request[1], first, count) not in requests:
            asked |= new
            requests.add((request[1], first, count))
            self._guess(unit, new)

    def set_apart(self, unit: int) -> None:
        """*unit* speaks no Modbus: it is of no family that is guessed."""
        self._apart.add(unit)
        for known in (self._fitting, self._likely):
            known.pop(unit, None)

    def withdrawn(self) -> list[tuple[int, str, int]]:
        """Guesses that were taken back since this was last asked.

        Each is a unit, the name of the family that it was taken for, and the address that does not fit.
        """
        taken_back, self._withdrawn = self._withdrawn, []
        return taken_back

    def values(self, request: bytes, answer: bytes | None) -> dict[str | int, Value]:
        """What *request* wrote or its *answer* carries: by names where the family is known, otherwise by addresses."""
        place, words = place_of(request), written_by(request)
        written = words is not None
        if words is None and answer is not None and answer[1] == request[1]:
            words = carried(answer, request)
        if place is None or not words:
            return {}
        profile, first, found = self.of(request[0], request), place[0], dict[str | int, Value]()
        at = 0
        while at < len(words):
            name = None if profile is None else profile.name_at(profile.plain_address(first + at), written=written)
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

    def _guess(self, unit: int, new: set[int]) -> None:
        """Says what *unit* may be, which was asked for *new* addresses."""
        asked, before = self._asked.get(unit, set()), self._fitting.get(unit)
        if len(asked) < _LEAST or len(self._requests[unit]) < _REQUESTS or unit in self._apart:
            return
        able = [Profile.builtin(name) for name in profiles()] if before is None else before
        words, refused = self._words.get(unit, {}), self._refused.get(unit, set())
        self._fitting[unit] = fitting = tuple(
            each
            for each in able
            if None not in _meant(each, asked) and _can_be(each, words) and not _denied(each, refused)
        )
        guessed = self._likely.get(unit)
        likely = tuple(each for each in fitting if _shows_itself(each, asked))
        if not likely and len(fitting) == 1 and len(asked) >= _MANY:
            likely = fitting
        self._likely[unit] = likely
        self._agreed.clear()
        if guessed and not likely:
            self._withdrawn.append((unit, guessed[0].name, _misfit(guessed[0], new)))

    def _agree(self, fitting: tuple[Profile, ...], request: bytes) -> bool:
        """Whether sisters mean the same by what *request* asks for: then it does not matter which of them it is."""
        place = place_of(request)
        if place is None:
            return True
        first, count = place
        key = (request[0], first, count)
        if key not in self._agreed:
            self._agreed[key] = len({_meant(each, range(first, first + count)) for each in fitting}) == 1
        return self._agreed[key]


def _shows_itself(profile: Profile, asked: set[int]) -> bool:
    """Whether nothing else is known by which *profile* is told, or some of that is among what was *asked*."""
    signature = profile.signature()
    return signature is None or not asked.isdisjoint(signature["answers"])


def _can_be(profile: Profile, words: Mapping[int, Iterable[tuple[int, bool]]]) -> bool:
    """Whether a unit of *profile* can have these *words*, by address; each with whether it was written."""
    return all(
        _allows(profile, address, word, is_written) for address, seen in words.items() for word, is_written in seen
    )


def _allows(profile: Profile, address: int, word: int, is_written: bool) -> bool:
    name = profile.name_at(profile.plain_address(address), written=is_written)
    if name is None:
        return False
    row = profile.describe(name)
    if row.words > 1 or row.variant is not None:
        return True
    try:
        value = float(profile.decode(name, word))
    except (DrivebusError, TypeError, ValueError):
        return True
    return (row.low is None or value >= row.low) and (row.high is None or value <= row.high)


def _denied(profile: Profile, refused: Iterable[tuple[int, int]]) -> bool:
    """Whether a unit said that it has not what *profile* has: spans of addresses, all of them known there."""
    return any(None not in _meant(profile, range(first, first + count)) for first, count in refused)


def _misfit(profile: Profile, addresses: set[int]) -> int:
    """The first of *addresses* that *profile* does not have; the first of all where it has them."""
    ordered = sorted(addresses)
    return next((each for each in ordered if profile.name_at(profile.plain_address(each)) is None), ordered[0])


def _meant(profile: Profile, addresses: Iterable[int]) -> tuple[object, ...]:
    """What *profile* means by each of *addresses*: name, unit, and what a word of 1000 is; None where it has none."""
    names = [profile.name_at(profile.plain_address(address)) for address in sorted(addresses)]
    return tuple(name and (name, profile.describe(name).unit, profile.decode(name, 1000)) for name in names)


def _unit(value: object) -> int:
    """An address that has a family, on whatever line it was heard; to 0 nobody answers on most."""
    return checks.unit(value) if value == 0 else EVERYBODY.unit(value)
