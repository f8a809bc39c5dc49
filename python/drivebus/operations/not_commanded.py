"""Why a command is not known to be carried out, in words: whether it went out, and what the motor may do now."""

from __future__ import annotations

from typing import Any

from drivebus import tables
from drivebus.advice import Text
from drivebus.errors import DrivebusError, NotReady, Refused, Unconfirmed
from drivebus.operations import bus_control, glances, not_led_up, not_ready, not_written, setpoints
from drivebus.operations.drive_view import DriveView
from drivebus.operations.said import A_WORD, MAY, said
from drivebus.operations.seen import afterwards, frames_of
from drivebus.values import ControlSource

__all__ = ["in_words"]


def in_words(
    unit: DriveView, command: str | None, found: float, kind: str, told: Any, *, hz: float = 0.0, confirm: float
) -> DrivebusError:
    """Why *command*, or None for a word that can move the motor, is not known to be carried out by *unit*.

    Args:
        unit: The unit.
        command: What was sent, or was to be.
        found: The line's clock when that was found.
        kind: Of which kind the reason is, as `_native.Unit.start` has it.
        told: What is told of it.
        hz: The frequency that was wanted.
        confirm: Seconds for which it was looked at.
    """
    name = A_WORD if command is None else command
    if kind == "not_ready":
        return not_ready.in_words(unit, command, *told)
    if kind == "not_set":
        return setpoints.not_set(unit, hz, *told)
    if kind == "not_written":
        return not_written.in_words(unit, *told)
    if kind == "not_led_up":
        number, why = told
        step = unit.profile.start_sequence()[number]
        error, cause = not_led_up.in_words(unit, name, step, found, confirm, *why)
    else:
        error, cause = _sent(unit, name, found, kind, told)
    error.__cause__ = cause
    return error


def _sent(unit: DriveView, name: str, found: float, kind: str, told: Any) -> tuple[DrivebusError, DrivebusError | None]:
    """The error of what was sent in part at least, or was held back by a halt; and what that came of."""
    if kind == "halted":
        return _halted(unit, name), told
    if kind == "halted_between":
        return _halted_between(unit, name), None if told is None else _chained(_halted(unit, name), told)
    if kind == "half_written":
        cause = not_written.in_words(unit, *told)
        return _half_written(unit, name, cause), cause
    if kind == "unanswered":
        error, after = told
        shown = after if isinstance(after, Exception) else glances.shown(unit, after)
        return _unanswered(unit, name, error, afterwards(unit, shown)), error
    if kind == "refused_and_turns":
        error, look = told
        return _refused_and_turns(unit, name, error, str(glances.shown(unit, look))), error
    if kind == "port_lost":
        return _port_lost(unit, name, told, found), told
    if kind == "ignored":
        wrong, unshown = told
        return _ignored(unit, wrong), in_words(unit, name, found, *unshown, confirm=0.0)
    if kind == "unread":
        return _unshown(unit, name, f"its last answer: {told}; {glances.seen_last(unit, found)}"), None
    return _unshown(unit, name, _seen_last(unit, *told)), None


def _halted(unit: DriveView, name: str) -> NotReady:
    return NotReady(
        f"unit {unit.address} was told to stop while {said(name)} was under way, or the port went to another "
        f"program: {said(name)} was not sent. Give it again if it is still wanted",
        why="halted",
        unit=unit.address,
    )


def _chained(error: DrivebusError, cause: DrivebusError) -> DrivebusError:
    error.__cause__ = cause
    return error


def _halted_between(unit: DriveView, name: str) -> Unconfirmed:
    return Unconfirmed(
        f"unit {unit.address} was told to stop when {_first(unit, name)}; the rest of it was not sent",
        unit=unit.address,
    )


def _half_written(unit: DriveView, name: str, cause: DrivebusError) -> Unconfirmed:
    return Unconfirmed(
        f"unit {unit.address} runs, and {_first(unit, name)}; the rest of it came to nothing ({cause}): it may turn "
        "the other way now. It was not repeated",
        unit=unit.address,
    )


def _first(unit: DriveView, name: str) -> str:
    first = unit.profile.command_first(name)
    place, word = (0, 0) if first is None else first
    return f"{word} had been sent to {tables.shown(place)}, which comes before {said(name)}"


def _unanswered(unit: DriveView, name: str, error: DrivebusError, shown: str) -> Unconfirmed:
    return Unconfirmed(
        f"{said(name)} was sent to unit {unit.address} and not confirmed ({error}); {MAY[name]}. {shown}. It was not "
        "repeated",
        unit=unit.address,
        **frames_of(error),
    )


def _refused_and_turns(unit: DriveView, name: str, refused: Refused, seen: str) -> Unconfirmed:
    return Unconfirmed(
        f"{said(name)} was sent to unit {unit.address} and refused ({refused}), and yet it turns: {seen}. It was not "
        "repeated",
        unit=unit.address,
        **frames_of(refused),
    )


def _port_lost(unit: DriveView, name: str, error: DrivebusError, found: float) -> Unconfirmed:
    return Unconfirmed(
        f"{said(name)} was sent to unit {unit.address}; the port was lost before its state showed it ({error}): "
        f"{MAY[name]}; {glances.seen_last(unit, found)}. It was not repeated",
        unit=unit.address,
    )


def _ignored(unit: DriveView, settings: list[Any]) -> Unconfirmed:
    items = [bus_control.item_of(unit, row) for row in settings]
    ignored = ", ".join(f"{item.code} is {int(item.actual or 0)}, needs {int(item.wanted)}" for item in items)
    return Unconfirmed(
        Text(
            f"unit {unit.address} did not reset: it does not take commands from the bus ({ignored}). The reset was "
            "sent once; ",
            *bus_control.preparing(unit),
            " sets the drive to obey the bus",
        ),
        unit=unit.address,
    )


def _unshown(unit: DriveView, name: str, last: str) -> Unconfirmed:
    return Unconfirmed(
        f"{said(name)} was sent to unit {unit.address}, and its state does not show it: {MAY[name]}; {last}. It was "
        "not repeated",
        unit=unit.address,
    )


def _seen_last(unit: DriveView, told: Any, _hz: float | None) -> str:
    seen = glances.shown(unit, told)
    last = f"state seen last: {seen}"
    if seen.source not in (ControlSource.COMMUNICATION, None):
        last += f", with commands from the {seen.source}"
    return last
