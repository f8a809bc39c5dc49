"""By what a drive of nobody's list is told from those of the list: words that it answers, and words that it refuses.

A profile of one's own without them has nothing to be told by: named at the address of another drive, what is a setpoint
to it may be a parameter in that one's EEPROM.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import drivebus
from drivebus import tables

__all__ = ["OwnSignature", "find"]

_MOST_ANSWERS, _MOST_REFUSES = 2, 4
_HELD = ("state", "frequency", "fault", "setpoints.frequency")
"""Roles whose registers such a drive has whatever it does, the best known first."""
_NO_FUNCTION, _NO_ADDRESS = 0x01, 0x02
_TAKEN_FOR_COMMANDS = range(0x0100, 0x0400)
"""Where a drive of Huanyang's own protocol may take a read for a command."""


class OwnSignature(NamedTuple):
    """What tells a drive from others.

    Attributes:
        answers: Places that it answers, one word each.
        refuses: Places that it has not, and others have.
        not_told: The families of which each unit may have all of the one and none of the other.
    """

    answers: tuple[int, ...]
    refuses: tuple[int, ...]
    not_told: tuple[str, ...]

    def rules(self) -> str:
        """The table of `profile.toml`."""
        return f"[identification.signature]\nanswers = [{_listed(self.answers)}]\nrefuses = [{_listed(self.refuses)}]\n"


def find(bus: drivebus.Bus, unit: int, profile: drivebus.Profile) -> OwnSignature | None:
    """Asks the unit that is there, of which *profile* was made, for words that tell it from others.

    Others are the known families that have something where the profile writes.

    Only reads are sent, one word each. None if it answers none of the words by which it would be known.

    Raises:
        NoAnswer, BadAnswer, PortError: The line failed.
    """
    own = [place for place in _places(profile, _HELD) if _may_be_asked(place)]
    answers = [place for place in own if _has(bus, unit, place)][:_MOST_ANSWERS]
    if not answers:
        return None
    others = [*_others(_written(profile))]
    known = {other.name: [*filter(_may_be_asked, _known_of(other))] for other in others}
    asked = {place: _has(bus, unit, place) for place in dict.fromkeys(place for has in known.values() for place in has)}
    refused = {place for place, is_there in asked.items() if is_there is False}
    told = {name: refused.intersection(has) for name, has in known.items()}
    alike = {other.name for other in others if all(_may_have(other, place) for place in answers)}
    refuses = _fewest(told, alike)
    left = (name for name in told if name in alike and not told[name] & set(refuses))
    return OwnSignature(tuple(answers), refuses, tuple(left))


def _others(written: Iterable[int]) -> Iterator[drivebus.Profile]:
    """The families that take some of *written* for theirs."""
    for other in map(drivebus.Profile.builtin, drivebus.profiles()):
        if other.requests().protocol == "modbus" and any(_may_have(other, place) for place in written):
            yield other


def _may_have(other: drivebus.Profile, place: int) -> bool:
    """Whether a unit of a family has a register or a parameter at *place*, as far as its profile tells."""
    return other.name_at(place) is not None or place >> 8 in other.unlisted_groups()


def _written(profile: drivebus.Profile) -> list[int]:
    """Where the profile writes."""
    rows = map(profile.describe, profile.names())
    return [row.place for row in rows if row.writable and row.place is not None]


def _known_of(other: drivebus.Profile) -> list[int]:
    """Where each unit of a family has something."""
    signature = other.signature() or {"answers": []}
    own = [] if other.identification_address is None else [other.identification_address]
    return [*signature["answers"], *own, *_places(other, _HELD[:1])]


def _places(profile: drivebus.Profile, roles: Sequence[str]) -> list[int]:
    rows = [profile.describe(name) for role in roles if (name := profile.role(role)) is not None]
    return [row.place for row in rows if row.place is not None and row.access != "wo"]


def _may_be_asked(place: int) -> bool:
    return place & 0xFFFF not in _TAKEN_FOR_COMMANDS


def _has(bus: drivebus.Bus, unit: int, place: int) -> bool | None:
    """Whether there is something at *place*; None where the unit says something else."""
    table, address = tables.split(place)
    try:
        bus.read(unit, address, table=table)
    except drivebus.Refused as error:
        lacks = error.code == _NO_ADDRESS or (error.code == _NO_FUNCTION and table != "holding")
        return False if lacks else None
    return True


def _fewest(told: Mapping[str, set[int]], alike: set[str]) -> tuple[int, ...]:
    """Few of the places that tell families: such that each of those *alike* has one, and many of the rest."""
    left = {name: places for name, places in told.items() if places}
    chosen: list[int] = []
    while left and (len(chosen) < _MOST_REFUSES or alike & left.keys()):
        having = {
            place: [name for name, places in left.items() if place in places]
            for place in sorted({place for places in left.values() for place in places})
        }
        best = max(having, key=lambda place: (len(alike.intersection(having[place])), len(having[place])))
        chosen.append(best)
        left = {name: places for name, places in left.items() if best not in places}
    return tuple(chosen)


def _listed(places: Iterable[int]) -> str:
    shown = (tables.split(place) for place in places)
    return ", ".join(f'"{"" if table == "holding" else f"{table} "}0x{address:04X}"' for table, address in shown)
