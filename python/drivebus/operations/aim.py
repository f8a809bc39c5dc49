"""As what a unit is halted: by the command of its name, or where it may be another drive by that of what it shows.

The code that stops one family starts another. A unit that this line has identified is taken for what it is. Of any
other a few words are asked first, before everything that waits for the line, and none of them again: `identify.apart`
says which, and what they tell. A unit that says nothing at all is taken for what it was named as, since silence is no
evidence; what it is is then asked behind the halt.
"""

from __future__ import annotations

from typing import NamedTuple

from drivebus.advice import Text, argument
from drivebus.errors import LINE_ERRORS, BadAnswer, NoAnswer, NotAllowed, WrongDrive
from drivebus.identify.apart import Apart
from drivebus.identify.families import asked_as, one_of
from drivebus.identify.harm import halt_of, harmed, harms
from drivebus.identify.refusals import answer_at, answer_once
from drivebus.line.asking import asking
from drivebus.line.frames import may_be_of
from drivebus.operations.drive_view import DriveView
from drivebus.profile import Profile, profiles

__all__ = ["ANSWER_WITHIN", "Aim", "Target", "check_harmless", "goes_out_at_once"]

ANSWER_WITHIN = 0.1
"""Seconds that a unit is given to answer what is asked before a halt, and the halt itself."""

_QUESTIONS = 24
"""Most questions about one unit; the longest way through the shipped families takes 15."""


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

    Attributes:
        heard: The line's clock when the unit last answered what it was asked, or may have.
    """

    def __init__(self, unit: DriveView) -> None:
        self.heard = unit.bus.now()
        self._unit = unit
        self._apart = Apart(unit.profile, trusted=unit.identity.trusted)
        self._doubted = False

    def doubt(self) -> bool:
        """Puts in doubt what it was halted as: what it says now decides, and silence says nothing. False if it was."""
        if self._doubted:
            return False
        self._apart, self._doubted = Apart(self._unit.profile, trusted=self._unit.identity.trusted), True
        return True

    async def take(self, command: str) -> Target | None:
        """As what to halt the unit by *command*, or None where it did not say yet.

        Raises:
            NotAllowed: It may be one of several families that want different words, or fits none. Nothing was sent.
            PortError: The port is lost.
        """
        unit = self._unit
        if not self._doubted and goes_out_at_once(unit, command):
            return Target(unit, command)
        ask = asking(unit.bus, urgent=True, timeout=ANSWER_WITHIN, retries=0)
        for _ in range(_QUESTIONS):
            verdict = self._apart.verdict(command)
            if verdict.take is not None:
                return self._as(verdict.take, command)
            if verdict.ask is None:
                raise _undecided(unit, command, verdict.others)
            try:
                answer = await answer_once(ask, unit.address, verdict.ask)
            except (NoAnswer, BadAnswer) as error:
                if may_be_of(unit.address, error.raw):
                    self.heard = unit.bus.now()
                    return None
                # Silence is no evidence. Where it spoke before, the line lost this one.
                return None if self._apart.is_asked or self._doubted else Target(unit, command)
            self.heard = unit.bus.now()
            if not self._apart.heard(answer):
                return None
        raise _undecided(unit, command, ())

    def _as(self, profile: Profile, command: str) -> Target:
        """The unit as one of *profile*."""
        unit = self._unit
        if profile is unit.profile:
            if self._apart.shows_named:
                unit.identity.settle(unit.bus)
            return Target(unit, command)
        halt = halt_of(profile, command)
        if halt is None:
            raise _undecided(unit, command, (profile,))
        # That its own papers are thin is no reason to let it run: nothing else halts what shows this family.
        return Target(unit.taken_for(profile), halt)


def goes_out_at_once(unit: DriveView, what: str | int) -> bool:
    """Whether nothing is asked before *what*: the line has identified the unit, or it harms no family.

    Where a name is said to be meant, only what the unit itself shows counts for a command. What speaks against a name
    is known of the shipped families alone: a unit of somebody's own one has to show it.

    Args:
        unit: The unit, as it was named.
        what: A command, or a place that any word may be written to.
    """
    identity, bus = unit.identity, unit.bus
    if identity.is_sure(bus):
        return True
    if isinstance(what, int) and (identity.trusted or identity.is_harmless(bus, what)):
        return True
    is_known = identity.is_known(bus) and not identity.trusted and unit.profile.family in profiles()
    return is_known or not harmed(unit.profile, what)


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
    if goes_out_at_once(unit, what):
        return
    apart = Apart(unit.profile, trusted=unit.identity.trusted)
    for _ in range(_QUESTIONS):
        verdict = apart.verdict(what)
        if verdict.ask is None:
            taken = verdict.take
            if taken is None or (taken is not unit.profile and harms(taken, unit.profile, what)):
                raise _another(unit, verdict.others if taken is None else (taken,))
            if isinstance(what, int):
                # Whoever would take harm from some word there, would from none that halts.
                if apart.shows_named and unit.profile.is_command(what):
                    unit.identity.settle(unit.bus)
                unit.identity.found_harmless(unit.bus, what)
            return
        try:
            answer = await answer_at(unit.bus.ask, unit.address, verdict.ask)
        except LINE_ERRORS as error:
            # `started` stays None: of what was to follow, nothing left.
            raise type(error)(
                f"unit {unit.address} does not say what it is ({error}); nothing was written to it",
                unit=unit.address,
                raw=error.raw,
            ) from error
        if not apart.heard(answer):
            break
    raise _another(unit, ())


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
