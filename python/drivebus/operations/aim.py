"""As what a unit is halted: by the command of its name, or where it may be another drive by that of what it shows.

The code that stops one family starts another. A unit that this line has identified is taken for what it is. Of any
other a few words are asked first, before everything that waits for the line, and none of them again. A unit that
says nothing at all is taken for what it was named as, since silence is no evidence; what it is is then asked behind the
halt.

What is asked, and as what the unit is taken, is decided in the core (`crates/drive`); here are the words for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from drivebus import _native
from drivebus.advice import Text, argument
from drivebus.errors import LINE_ERRORS, NotAllowed, WrongDrive
from drivebus.identify.families import asked_as, one_of
from drivebus.identify.refusals import busy
from drivebus.line.tasks import carried_out
from drivebus.operations.drive_view import DriveView
from drivebus.profile import Profile

__all__ = ["ANSWER_WITHIN", "Aim", "Target", "check_harmless", "goes_out_at_once"]

ANSWER_WITHIN = _native.ANSWER_WITHIN
"""Seconds that a unit is given to answer what is asked before a halt, and the halt itself."""


class Target(NamedTuple):
    """What is sent to halt a unit.

    Attributes:
        unit: The unit, as the family that it is taken for.
        command: The command of that family.
    """

    unit: DriveView
    command: str


class Aim:
    """The look at one unit that comes before a halt. What was answered is kept between two tries.

    Args:
        unit: The unit, as it was named.
    """

    def __init__(self, unit: DriveView) -> None:
        self._unit = unit
        self._aim = _native.Aim(_seen(unit), unit.bus.now())

    @property
    def heard(self) -> float:
        """The line's clock when the unit last answered what it was asked, or may have."""
        return self._aim.heard

    def doubt(self) -> bool:
        """Puts in doubt what it was halted as: what it says now decides, and silence says nothing. False if it was."""
        return self._aim.doubt()

    async def take(self, command: str) -> Target | None:
        """As what to halt the unit by *command*, or None where it did not say yet.

        Raises:
            NotAllowed: It may be one of several families that want different words, or fits none. Nothing was sent.
            PortError: The port is lost.
        """
        unit = self._unit
        kind, told = await carried_out(self._aim.take(command), unit.bus)
        if kind == "unsaid":
            return None
        if kind == "may_be":
            raise _undecided(unit, command, _profiles(unit, told))
        [profile] = _profiles(unit, told[:1])
        # That its own papers are thin is no reason to let it run: nothing else halts what shows this family.
        return Target(unit if profile is unit.profile else unit.taken_for(profile), told[1])


def goes_out_at_once(unit: DriveView, what: str | int) -> bool:
    """Whether nothing is asked before *what*: the line has identified the unit, or it harms no family.

    Where a name is said to be meant, only what the unit itself shows counts for a command. What speaks against a name
    is known of the shipped families alone: a unit of somebody's own one has to show it.

    Args:
        unit: The unit, as it was named.
        what: A command, or a place that any word may be written to.
    """
    return _native.goes_out_at_once(_seen(unit), what, unit.bus.reconnects)


async def check_harmless(unit: DriveView, what: str | int) -> None:
    """Makes sure that *what* is not sent to a unit of a family that it would do harm to.

    Sends reads, and only where the line has not identified the unit.

    Args:
        unit: The unit, as it was named.
        what: A command that does not halt, or a place that any word may be written to.

    Raises:
        NotAllowed: It shows such a family, or may be one. Nothing was written.
        NoAnswer, BadAnswer, PortError: The line failed, or the unit is busy; nothing was written.
    """
    try:
        kind, told = await carried_out(_native.check_harmless(_seen(unit), what), unit.bus)
        if kind == "busy":
            raise busy(unit.address, *told) from told[-1]
    except LINE_ERRORS as error:
        # `started` stays None: of what was to follow, nothing left.
        raise type(error)(
            f"unit {unit.address} does not say what it is ({error}); nothing was written to it",
            unit=unit.address,
            raw=error.raw,
        ) from error
    if kind == "may_be":
        raise _another(unit, _profiles(unit, told))


def _seen(unit: DriveView) -> _native.SameUnit:
    return unit.identity.seen_as(unit.profile)


def _profiles(unit: DriveView, names: Iterable[str]) -> tuple[Profile, ...]:
    """The families of *names*: of a name that it shares with a shipped one, the named one is the one that is meant."""
    return tuple(unit.profile if name == unit.profile.name else Profile.builtin(name) for name in names)


def _undecided(unit: DriveView, command: str, others: tuple[Profile, ...]) -> NotAllowed:
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
