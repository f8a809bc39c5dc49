"""What a word that is meant for one family does to a unit of another one: derived from all profiles, listed nowhere.

At one address a word stops one family, starts another and is a parameter of a third. What stops a motor may be sent to
a unit of which nothing is known only where it does none of that to any family.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable

from drivebus import places
from drivebus.profile import Profile, profiles

__all__ = ["HALTS", "families", "halt_of", "harmed", "harms"]

HALTS = ("stop", "coast", "jog_stop")
"""The commands that end a motion, in the order of who else may stand in for one that a family lacks."""


def families(own: Profile) -> tuple[Profile, ...]:
    """The shipped families, with *own* before them: of a name that it shares with one, it is the one that is meant."""
    return (own, *(profile for profile in _shipped() if profile.name != own.name))


def halt_of(profile: Profile, command: str) -> str | None:
    """The command by which units of *profile* do what *command* is for; None where they have none that halts.

    A family without a jog stop ends a jog by its stop, and one without a coast only has its stop.
    """
    known = profile.commands()
    return next((name for name in (command, "stop", "coast") if name in known), None)


@functools.lru_cache(maxsize=512)
def harmed(named: Profile, command: str) -> tuple[Profile, ...]:
    """The families that *command* of *named* would do harm to; none where it has no such command."""
    if command not in named.commands():
        return ()
    return tuple(profile for profile in families(named) if profile is not named and harms(profile, named, command))


def harms(profile: Profile, named: Profile, command: str) -> bool:
    """Whether one of the words that *command* of *named* is made of does harm to a unit of *profile*."""
    words: Iterable[tuple[int, int] | None] = (named.command_first(command), named.command(command))
    return any(_does_harm(profile, *each, command) for each in words if each is not None)


@functools.lru_cache(maxsize=8192)
def _does_harm(profile: Profile, place: int, word: int, command: str) -> bool:
    """Whether *word* at *place*, meant as *command*, starts, reverses or sets anything in a unit of *profile*.

    At a command register whatever is no halt of the family counts: nobody prints what each other code does.
    """
    table, address = places.split(place)
    plain = profile.plain_address(address) if table == "holding" else place
    for each in {place, plain}:
        if each in profile.command_registers() or profile.is_command(each):
            same = (command,) if command not in HALTS else HALTS
            known = [profile.command(name) for name in same if name in profile.commands()]
            return (place, word) not in known
    for each in {place, plain}:
        name = profile.name_at(each, written=True)
        if name is not None:
            return profile.describe(name).access != "ro"
    return table == "holding" and plain >> 8 in profile.parameter_groups()


@functools.cache
def _shipped() -> tuple[Profile, ...]:
    return tuple(map(Profile.builtin, profiles()))
