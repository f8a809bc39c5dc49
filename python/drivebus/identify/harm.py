"""What a word that is meant for one family does to a unit of another one: derived from all profiles, listed nowhere.

At one address a word stops one family, starts another and is a parameter of a third. What stops a motor may be sent to
a unit of which nothing is known only where it does none of that to any family.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable

from drivebus import tables
from drivebus.profile import Profile, profiles
from drivebus.values import Description

__all__ = ["HALTS", "families", "halt_of", "harmed", "harms"]

HALTS = ("stop", "coast", "jog_stop")
"""The commands that end a motion, in the order of who else may stand in for one that a family lacks."""

_BIT_OF = {"ram": False, "eeprom": True}
"""Whether the bit of an address that has one for RAM or EEPROM is set where EEPROM keeps the word."""


def families(own: Profile) -> tuple[Profile, ...]:
    """The shipped families, with *own* before them: of a name that it shares with one, it is the one that is meant."""
    return (own, *(profile for profile in _shipped() if profile.name != own.name))


def halt_of(profile: Profile, command: str) -> str | None:
    """The command by which units of *profile* do what *command* is for; None where they have none that halts.

    A family without a jog stop ends a jog by its stop, and one without a coast only has its stop.
    """
    known = profile.commands()
    return next((name for name in (command, "stop", "coast") if name in known), None)


@functools.lru_cache(maxsize=4096)
def harmed(named: Profile, what: str | int) -> tuple[Profile, ...]:
    """The families that *what* is written to a unit of *named* would do harm to; none where it has no such command."""
    if isinstance(what, str) and what not in named.commands():
        return ()
    return tuple(profile for profile in families(named) if profile is not named and harms(profile, named, what))


def harms(profile: Profile, named: Profile, what: str | int) -> bool:
    """Whether *what* is written to a unit of *named* does harm to one of *profile*.

    Args:
        profile: The family that the unit may be of.
        named: The family that it was named as.
        what: A command of *named*, or a place that any word may be written to.
    """
    if isinstance(what, int):
        return _starts_or_keeps(profile, what)
    words: Iterable[tuple[int, int] | None] = (named.command_first(what), named.command(what))
    return any(_does_harm(profile, *each, what) for each in words if each is not None)


@functools.lru_cache(maxsize=8192)
def _does_harm(profile: Profile, place: int, word: int, command: str) -> bool:
    """Whether *word* at *place*, meant as *command*, starts, reverses or sets anything in a unit of *profile*.

    At a command register whatever is no halt of the family counts: nobody prints what each other code does.
    """
    for each in _both(profile, place):
        if _commands(profile, each):
            same = (command,) if command not in HALTS else HALTS
            known = [profile.command(name) for name in same if name in profile.commands()]
            return (place, word) not in known
    row = _row(profile, place)
    return _may_have_parameter(profile, place) if row is None else row.access != "ro"


@functools.lru_cache(maxsize=65536)
def _starts_or_keeps(profile: Profile, place: int) -> bool:
    """Whether a word written to *place* may start a unit of *profile*, or is kept in its EEPROM."""
    if any(_commands(profile, each) for each in _both(profile, place)):
        return True
    row = _row(profile, place)
    is_parameter = (
        _may_have_parameter(profile, place) if row is None else row.kind == "parameter" and row.access != "ro"
    )
    memory = profile.memory()
    if not is_parameter or memory is None:
        return is_parameter
    return bool(place >> memory.bit & 1) is _BIT_OF[memory.means]


def _both(profile: Profile, place: int) -> tuple[int, ...]:
    """*place*, and where it is read if it has the bit that says where a parameter is kept."""
    table, address = tables.split(place)
    plain = profile.plain_address(address) if table == "holding" else place
    return (place,) if plain == place else (place, plain)


def _commands(profile: Profile, place: int) -> bool:
    """Whether units of *profile* take commands at *place*."""
    return place in profile.command_registers() or profile.is_command(place)


def _row(profile: Profile, place: int) -> Description | None:
    """What *profile* knows to be written at *place*; None where it has no row."""
    names = (profile.name_at(each, written=True) for each in _both(profile, place))
    name = next(filter(None, names), None)
    return None if name is None else profile.describe(name)


def _may_have_parameter(profile: Profile, place: int) -> bool:
    """Whether *place* is where units of *profile* have parameters, by the rule of their addresses."""
    table, _ = tables.split(place)
    return table == "holding" and _both(profile, place)[-1] >> 8 in profile.parameter_groups()


@functools.cache
def _shipped() -> tuple[Profile, ...]:
    return tuple(map(Profile.builtin, profiles()))
