"""What is checked before a motor is started: the link, the drive, and that it can be stopped again.

Every start goes through here, whatever asks for it: `motion` for run and jog, of both faces, of the command line, the
panel and HAL; `bit_words` for bits that may start one. A new reason against a start is a check in `ready_to_start`, its
word in `errors.Why`, and a line in docs/developers/guarantees.md.
"""

from __future__ import annotations

from drivebus.advice import Advice, Text, argument, call
from drivebus.errors import BadAnswer, BadLink, NoAnswer, NotReady, Refused
from drivebus.look import Look
from drivebus.operations import bus_control, start_sequence, state
from drivebus.operations.drive_view import DriveView
from drivebus.profile.evidence import Evidence
from drivebus.values import ControlSource, State

__all__ = ["can_be_stopped", "check_at_rest", "may_be_given", "prove_link", "ready_to_start"]

_FAILURES_ALLOWED = 1
"""Of the last ten exchanges with a unit. One answer in ten may be lost on a line that works, to a burst of noise. Where
two are, the next may be the one that stops the motor."""

_LOOKS_TO_PROVE = 10
"""Looks at the state that prove a link in doubt: as many as `Link` counts, so that the old ones count no more."""


def may_be_given(unit: DriveView, command: str) -> None:
    """Raises `NotAllowed` where *command* may not be given, or what it starts could not be stopped again."""
    unit.evidence.require_command(command)
    start_sequence.check_seen(unit)
    can_be_stopped(unit)


def can_be_stopped(unit: DriveView) -> None:
    """Raises `NotAllowed` where a motor that turns could not be stopped over the bus."""
    reasons = {halt: unit.evidence.unusable(halt) for halt in ("stop", "coast")}
    if all(reasons.values()):
        told = "; ".join(f"{halt}: {(reason or '').rstrip('.')}" for halt, reason in reasons.items())
        what = f"a motor that unit {unit.address} starts could not be stopped over the bus"
        raise unit.evidence.missing(what, told, _both_unusable)


async def prove_link(unit: DriveView, force: bool) -> None:
    """No motor starts on a link that may not carry its stop. Sends nothing where the last exchanges went well."""
    link = await unit.bus.link(unit.address)
    if force or link.failed <= _FAILURES_ALLOWED:
        return
    lost = looks = 0
    while looks < _LOOKS_TO_PROVE and lost <= _FAILURES_ALLOWED:
        looks += 1
        try:
            await state.ping(unit)
        except Refused:
            pass
        except (NoAnswer, BadAnswer):
            lost += 1
    link = await unit.bus.link(unit.address)
    if lost > _FAILURES_ALLOWED or link.failed > _FAILURES_ALLOWED:
        raise BadLink(
            Text(
                f"the link to unit {unit.address} is bad: {link}, and {lost} of {looks} looks at its state failed; "
                "nothing that moves it was sent, for its stop might be lost as well. Mend the line (",
                Advice("stats", None, "bus.stats()"),
                " may say how), or start anyway with ",
                argument("force", True),
            ),
            unit=unit.address,
        )


async def ready_to_start(unit: DriveView, *, by_bus: bool = True) -> Look:
    """How the drive stands. Raises `NotAllowed` where it would not start, or not obey the bus (*by_bus*)."""
    await bus_control.check_set(unit, bus_control.wanted_always(unit), "has its words elsewhere")
    seen = await state.glance(unit)
    if seen.tripped:
        raise NotReady(
            Text(
                f"unit {unit.address} is in fault {seen.fault or '(not named)'}; nothing that moves it was sent. "
                "Remove the cause, then ",
                call("reset_fault"),
            ),
            why="fault",
            unit=unit.address,
        )
    if seen.state is State.POWER_OFF:
        raise NotReady(
            f"unit {unit.address} has no voltage on its DC bus; nothing that moves it was sent",
            why="no_voltage",
            unit=unit.address,
        )
    if by_bus and seen.source not in (ControlSource.COMMUNICATION, None):
        raise NotReady(
            Text(
                f"unit {unit.address} takes its commands from the {seen.source}, not from the bus; nothing that moves "
                "it was sent. ",
                call("prepare_control"),
                " sets it to obey the bus",
            ),
            why="control_source",
            unit=unit.address,
        )
    if by_bus and seen.source is None:
        left = [row for row in bus_control.wanted_of_commands(unit) if not row.always]
        await bus_control.check_set(unit, left, "does not take its commands from the bus")
    return seen


def check_at_rest(unit: DriveView, seen: Look) -> None:
    """Raises `NotAllowed` where the motor turns already: a jog could not be told from what it does."""
    if seen.state.running:
        raise NotReady(
            Text(
                f"unit {unit.address} turns already ({seen.state}); nothing that moves it was sent. ",
                Advice("stop_and_wait", None, "stop() it, and wait_until_stopped(),"),
                " before a jog",
            ),
            why="turning",
            unit=unit.address,
        )


def _both_unusable(evidence: Evidence) -> str | None:
    """Why a motor could not be stopped; None if it could."""
    return evidence.unusable("stop") and evidence.unusable("coast")
