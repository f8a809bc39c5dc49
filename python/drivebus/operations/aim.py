"""As what a unit is halted: by the command of its name, or where it may be another drive by that of what it shows.

The code that stops one family starts another. A unit that this line has identified is taken for what it is. Of any
other a few words are asked first, before everything that waits for the line, and none of them again. A unit that
says nothing at all is taken for what it was named as, since silence is no evidence; what it is is then asked behind the
halt.

What is asked, and as what the unit is taken, is decided in the core (`crates/drive`); here are the words for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drivebus.advice import Text, argument
from drivebus.errors import LINE_ERRORS, DrivebusError, NotAllowed, WrongDrive
from drivebus.identify.families import asked_as, one_of
from drivebus.identify.refusals import busy
from drivebus.operations import other_words
from drivebus.operations.drive_view import DriveView
from drivebus.profile import Profile

__all__ = ["harmed", "profiles_of", "undecided"]


def harmed(unit: DriveView, kind: str, told: Any) -> DrivebusError:
    """Why nothing was written to *unit*: of which *kind* that is, and what is *told* of it, as the core has them.

    It shows a family that would take harm, or may be one; or the line failed, or the unit is busy.
    """
    if kind == "may_be":
        return _another(unit, profiles_of(unit, told))
    if kind == "set_otherwise":
        return other_words.not_written(unit, other_words.SetOtherwise(*told))
    error: DrivebusError = told
    if kind == "busy":
        error = busy(unit.address, *told)
        error.__cause__ = told[-1]
    if not isinstance(error, LINE_ERRORS):
        return error
    # `started` stays None: of what was to follow, nothing left.
    unsaid = type(error)(
        f"unit {unit.address} does not say what it is ({error}); nothing was written to it",
        unit=unit.address,
        raw=error.raw,
    )
    unsaid.__cause__ = error
    return unsaid


def profiles_of(unit: DriveView, names: Iterable[str]) -> tuple[Profile, ...]:
    """The families of *names*: of a name that it shares with a shipped one, the named one is the one that is meant."""
    return tuple(unit.profile if name == unit.profile.name else Profile.builtin(name) for name in names)


def undecided(unit: DriveView, command: str, others: tuple[Profile, ...]) -> NotAllowed:
    """Why *command* does not go out: *unit* may be any of *others*, or where there are none fits no family."""
    named = f"unit {unit.address} was named {unit.profile.name} ({unit.profile.title})"
    if not others:
        return WrongDrive(
            Text(
                f"{named}, and what it answers fits neither that nor another family that can be halted over the bus: "
                f"{command} was not sent, for it may start a drive of another family. If it is meant, say ",
                argument("trust_profile", True),
                ". If a motor must stop now, use the emergency stop",
            ),
            unit=unit.address,
        )
    return WrongDrive(
        Text(
            f"{named}, and by what it answers it may be {_titles(others)}, which want different words: {command} was "
            "not sent, for it may start the motor. If you know which it is, say ",
            one_of(argument("profile", profile.name) for profile in others),
            ". If it must stop now, use the emergency stop",
        ),
        unit=unit.address,
    )


def _another(unit: DriveView, others: tuple[Profile, ...]) -> NotAllowed:
    then = Text(": ask for it as that: ", asked_as(unit.address, (each.name for each in others))) if others else ""
    return WrongDrive(
        Text(
            f"unit {unit.address} was named {unit.profile.name} ({unit.profile.title}), and by what it answers and "
            f"refuses it may be {_titles(others)}",
            then,
            "; or say ",
            argument("trust_profile", True),
            " if it is meant; nothing was written to it",
        ),
        unit=unit.address,
    )


def _titles(families: tuple[Profile, ...]) -> str:
    return one_of(f"{each.title} ({each.name})" for each in families) if families else "a drive of another family"
