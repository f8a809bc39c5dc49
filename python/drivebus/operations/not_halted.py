"""Why a unit is not known to be halted, in words: whether the halt went out, and what the motor may do now."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from drivebus.errors import DrivebusError, NotAllowed, Refused, Unconfirmed
from drivebus.identify.contradiction import in_words as contradiction
from drivebus.operations import glances, other_words
from drivebus.operations.aim import profiles_of, undecided
from drivebus.operations.drive_view import DriveView
from drivebus.operations.said import MAY, said
from drivebus.operations.seen import afterwards, frames_of
from drivebus.profile.evidence import refusal_of
from drivebus.values import ControlSource

__all__ = ["in_words"]


def in_words(named: DriveView, unit: DriveView, command: str, found: float, reason: str, told: Any) -> DrivebusError:
    """Why *command* is not known to have halted *unit*, which was *named* so.

    Args:
        named: The unit as it was named.
        unit: The same, as the family that it is taken for.
        command: What was sent last.
        found: The line's clock when that was found.
        reason: Of which kind the reason is, as `_native.Halt` has it.
        told: What is told of it.
    """
    if reason == "failed":
        failed: DrivebusError = told
        return failed
    cause = None
    if reason in ("may_not", "undecided", "set_otherwise"):
        error = _not_sent(named, unit, command, reason, told)
    elif reason == "unsaid":
        error = _unsaid(unit, command, found)
    elif reason == "not_sent":
        error, cause = _not_out(unit, command, told), told
    elif reason in ("refused", "unanswered"):
        error, cause = _not_taken(unit, command, found, *told), told[0]
    elif reason == "unasked":
        error, cause = _unasked(unit, command, told, found), told
    elif reason == "another":
        error, cause = _another(named, unit, command, *told)
    elif reason == "port_lost":
        error, cause = _port_lost(unit, command, told, found), told
    elif reason == "unread":
        error = _unshown(unit, command, f"its last answer: {told}; {glances.seen_last(unit, found)}")
    else:
        error = _unshown(unit, command, _seen_last(unit, *told))
    error.__cause__ = cause
    return error


def _not_sent(named: DriveView, unit: DriveView, command: str, reason: str, told: Any) -> DrivebusError:
    """Why nothing may be sent at all."""
    if reason == "undecided":
        wanted, families = told
        return undecided(named, wanted, profiles_of(named, families))
    if reason == "set_otherwise":
        wanted, otherwise = told
        return other_words.refused(unit, wanted, other_words.SetOtherwise(*otherwise))
    if reason == "failed":
        failed: DrivebusError = told
        return failed
    return refusal_of(unit.evidence.require_command, command)


def _unsaid(unit: DriveView, command: str, found: float) -> DrivebusError:
    return Unconfirmed(
        f"unit {unit.address} is busy, and does not say what it is: {command} was not sent, for it may start "
        f"a drive of another family; {MAY[command]}, {glances.seen_last(unit, found)}. If it must stop now, use the "
        "emergency stop",
        unit=unit.address,
    )


def _not_out(unit: DriveView, command: str, error: DrivebusError) -> DrivebusError:
    return type(error)(
        f"{said(command)} could not be sent to unit {unit.address} ({error}); {MAY[command]}",
        unit=unit.address,
        request=error.request,
        ended=error.ended,
    )


def _not_taken(
    unit: DriveView,
    command: str,
    found: float,
    error: DrivebusError,
    sent: tuple[list[str], float, float | None],
    after: Any,
) -> DrivebusError:
    told, took, heard = sent
    times = f"{len(told)} times within {took:.1f} s" if len(told) != 1 else "once"
    was_sent = f"{_each_once(told)} was sent to unit {unit.address} {times}"
    shown = after if isinstance(after, Exception) else glances.shown(unit, after)
    then = f"{MAY[command]}. {afterwards(unit, shown, found)}"
    if isinstance(error, Refused):
        return Refused(
            f"{was_sent} and not taken, at last: {error}; {then}",
            code=error.code,
            name=error.name,
            meaning=error.meaning,
            means=error.means,
            unit=unit.address,
            **frames_of(error),
        )
    silent = "nothing came from it at all"
    if heard is not None:
        silent = f"the last that came from it came {heard:.1f} s ago"
    return Unconfirmed(
        f"{was_sent} and not confirmed ({error}): {silent}; {then}",
        unit=unit.address,
        **frames_of(error),
    )


def _each_once(told: Iterable[str]) -> str:
    return " or ".join(map(said, dict.fromkeys(told)))


def _unasked(unit: DriveView, command: str, error: DrivebusError, found: float) -> DrivebusError:
    return Unconfirmed(
        f"{said(command)} was sent to unit {unit.address} and taken, and what the unit "
        f"is could not be asked ({error}): by another family it may mean something else; "
        f"{MAY[command]}; {glances.seen_last(unit, found)}",
        unit=unit.address,
    )


def _another(
    named: DriveView, unit: DriveView, command: str, against: Any, then: tuple[str, Any]
) -> tuple[DrivebusError, DrivebusError | None]:
    """It was taken by a unit that is another one than was halted, and why; and what that came of."""
    reason, told = then
    error = None if reason == "unsaid" else _not_sent(named, unit, command, reason, told)
    if not isinstance(error, NotAllowed | None):
        return error, error.__cause__ if isinstance(error.__cause__, DrivebusError) else None
    what = "it did not say what it is instead" if error is None else str(error)
    if against is not None:
        what = f"{contradiction(named.profile, unit.address, against)}, and {what}"
    return Unconfirmed(
        f"{said(command)} was sent to unit {unit.address} and taken; but {what}. {MAY[command]}",
        unit=unit.address,
    ), error


def _port_lost(unit: DriveView, command: str, error: DrivebusError, found: float) -> DrivebusError:
    return Unconfirmed(
        f"{said(command)} was sent to unit {unit.address}; the port was lost before its state showed it "
        f"({error}): {MAY[command]}; {glances.seen_last(unit, found)}",
        unit=unit.address,
    )


def _unshown(unit: DriveView, command: str, last: str) -> DrivebusError:
    return Unconfirmed(
        f"{said(command)} was sent to unit {unit.address}, and its state does not show it: {MAY[command]}; {last}",
        unit=unit.address,
    )


def _seen_last(unit: DriveView, told: Any, hz: float | None) -> str:
    seen = glances.shown(unit, told)
    last = f"state seen last: {seen}"
    if hz is not None:
        last += f", at {hz:g} Hz"
    if seen.source not in (ControlSource.COMMUNICATION, None):
        last += f", with commands from the {seen.source}"
    return last
