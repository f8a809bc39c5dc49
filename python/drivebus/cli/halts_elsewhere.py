"""Which halts of one family are the start of another: the same word, at the same place, by the same function."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import drivebus
from drivebus import tables
from drivebus.line.write_guard import code_text

__all__ = ["Started", "started_by"]

_HALTS = ("stop", "coast", "jog_stop")
_STARTS = ("run_forward", "run_reverse", "jog_forward", "jog_reverse")

_WRITE_COIL, _WRITE_ONE, _WRITE_MANY = 0x05, 0x06, 0x10


class Started(NamedTuple):
    """A halt of one family that starts others.

    Attributes:
        halt: The command of the one.
        place: Where its code is written.
        code: The code.
        function: By which function.
        command: What it is to the others.
        families: The others, by name.
    """

    halt: str
    place: int
    code: int
    function: int
    command: str
    families: tuple[str, ...]

    def __str__(self) -> str:
        return (
            f"{self.halt} ({code_text(self.code)} at {tables.shown(self.place)}, by {self.function:02X}H) is "
            f"{self.command} of {', '.join(self.families)}"
        )


def started_by(profile: drivebus.Profile) -> Iterator[Started]:
    """The halts of *profile* that start shipped families other than its own."""
    others = [other for other in map(drivebus.Profile.builtin, drivebus.profiles()) if other.family != profile.family]
    known = profile.commands()
    for halt in (name for name in _HALTS if name in known):
        place, code = profile.command(halt)
        function = _function(profile, place)
        for command in _STARTS:
            families = tuple(
                other.name
                for other in others
                if function in other.functions
                and command in other.commands()
                and other.command(command) == (place, code)
            )
            if families:
                yield Started(halt, place, code, function, command, families)


def _function(profile: drivebus.Profile, place: int) -> int:
    """By which function a single word goes to *place*."""
    table, _ = tables.split(place)
    if table == "coil":
        return _WRITE_COIL
    return _WRITE_MANY if _WRITE_ONE not in profile.functions and _WRITE_MANY in profile.functions else _WRITE_ONE
