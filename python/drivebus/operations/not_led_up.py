"""Why a word that some drives want before they run came to nothing, in words; the core has the kind of the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from drivebus.advice import Text, call
from drivebus.errors import LINE_ERRORS, DrivebusError, Unconfirmed
from drivebus.look import Look
from drivebus.operations import glances, not_written
from drivebus.operations.drive_view import DriveView
from drivebus.operations.said import said

if TYPE_CHECKING:
    from drivebus.profile.facts import StartStep

__all__ = ["in_words"]

_ADVICE = "See what holds it back (its terminals, its mains, its keypad, who else commands it), then start it again"


def in_words(
    unit: DriveView, command: str, step: StartStep, found: float, within: float, kind: str, told: Any
) -> tuple[DrivebusError, DrivebusError | None]:
    """Why *step* came to nothing, so that *command* was not sent to *unit*; and what that came of.

    Args:
        unit: The unit.
        command: What was to follow.
        step: The word, as `Profile.start_sequence` has it.
        found: The line's clock when that was found.
        within: Seconds for which the state was looked at.
        kind: Of which kind the reason is, as `_native.Unit.start` has it.
        told: What is told of it.
    """
    called = f"{step['label']} ({step['word']:04X}H)"
    if kind == "halted_before":
        return _failed(unit, command, f"it was told to stop before {called} was sent"), not_written.in_words(
            unit, *told
        )
    if kind == "not_written":
        error = not_written.in_words(unit, *told)
        sent = "could not be sent" if error.started is None else "was sent and not confirmed"
        return _failed(unit, command, f"{called} {sent} ({error})", error), error
    if kind == "halted":
        return _failed(unit, command, f"it was told to stop when {called} had been sent"), None
    if kind == "tripped":
        fault = glances.shown(unit, told).fault or "(not named)"
        trip = f"it is in fault {fault} since {called} was sent. Remove the cause, then "
        return _failed(unit, command, Text(trip, call("reset_fault"))), None
    if kind == "port_lost":
        return _failed(unit, command, f"the port was lost when {called} had been sent ({told})", told), told
    if kind == "unread":
        last = f"its last answer was {told}; {glances.seen_last(unit, found)}"
    else:
        last = _told(unit, step, glances.shown(unit, told[0]))
    return _failed(
        unit, command, f"{called} was sent, once, and {last}, within {within:g} s (`confirm`). {_ADVICE}"
    ), None


def _told(unit: DriveView, step: StartStep, seen: Look) -> str:
    """What the state word shows, and where that is not what is waited for."""
    name, word = unit.profile.role("state"), seen.word
    if name is None or word is None:
        return f"its state is not known: {seen}"
    fields = unit.profile.fields(name, word)
    wanted = {field: unit.profile.fields(name, step.value)[field] for field in step.until}
    differ = [f"{field} {fields[field]} and not {label}" for field, label in wanted.items() if fields[field] != label]
    return f"its state word shows {word:04X}H ({seen}), with {', '.join(differ)}"


def _failed(unit: DriveView, command: str, why: str, error: DrivebusError | None = None) -> Unconfirmed:
    lost = error if isinstance(error, LINE_ERRORS) else None
    return Unconfirmed(
        Text(f"unit {unit.address} was not started: ", why, f". {said(command)} was not sent"),
        unit=unit.address,
        request=b"" if lost is None else lost.request,
        started=None if lost is None else lost.started,
        ended=None if lost is None else lost.ended,
    )
