"""One command to one drive: sent once, and proved by what the drive's own state says afterwards. A halt is `halting`.

Where the family has no state that may be used, the drive's confirmation of the command is the proof, and its fault
number is looked at.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import Any, TypeAlias

from drivebus import tables
from drivebus.errors import (
    LINE_ERRORS,
    BadAnswer,
    DrivebusError,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
    Unconfirmed,
)
from drivebus.look import Look
from drivebus.operations import events, raw_words, setpoints, state
from drivebus.operations.drive_view import DriveView
from drivebus.values import ControlSource

__all__ = [
    "MAY",
    "POLL_INTERVAL",
    "afterwards",
    "confirm",
    "frames_of",
    "prepared",
    "send",
    "send_word",
    "state_afterwards",
]

POLL_INTERVAL = 0.02
"""Seconds of the line's clock between two looks at the state."""

_LONG_LOOK = 0.5
"""Seconds of the line's clock that a look takes only where it waits until nothing that is late can be mistaken."""

_WRITE_MANY = 0x10

A_WORD = "a word that can move the motor"

MAY = {
    A_WORD: "the motor may turn",
    "run_forward": "the motor may turn",
    "run_reverse": "the motor may turn",
    "jog_forward": "the motor may turn",
    "jog_reverse": "the motor may turn",
    "stop": "the motor may still turn",
    "coast": "the motor may still be powered",
    "jog_stop": "the motor may still turn",
    "reset_fault": "the fault may be reset, and a drive that is still told to run may start",
}
"""What may have happened when a command was sent and nothing is known of it."""


def said(command: str) -> str:
    """*command* as people say it: `fault reset` for `reset_fault`."""
    return "fault reset" if command == "reset_fault" else command.replace("_", " ")


_WHATEVER_IT_IS = ("reset_fault",)
"""Commands that are given to a unit that contradicts its profile too, as those that halt are: whether a drive gets out
of a fault shall not depend on a name. It has shown that fault in the words of the profile. One that behaves as a unit
of another family gets none: that word may start its motor."""


Words: TypeAlias = tuple[int, int | Sequence[int]]
"""An address, and the word or words that go there."""


async def prepared(unit: DriveView, name: str, setpoint: int | None) -> Words:
    """Where the command goes, and what goes there: the setpoint behind it, where the drive has both side by side.

    Where it has not, the setpoint is sent now.
    """
    address, code = unit.profile.command(name)
    if setpoint is not None:
        together = _WRITE_MANY in unit.profile.functions
        if together and unit.profile.address(setpoints.register_of(unit, "frequency")) == address + 1:
            return address, [code, setpoint]
        await setpoints.write_word(unit, setpoint)
    return address, code


async def send(unit: DriveView, name: str, words: Words | None = None) -> None:
    """Sends a command, once. Where another word says which way the motor turns, that goes out first, once too.

    Args:
        unit: Who gets it.
        name: What it is called.
        words: Where it goes and what goes there, as `prepared` has it; None is what the profile says.
    """
    address, payload = unit.profile.command(name) if words is None else words
    first = unit.profile.command_first(name)
    if first is None:
        await send_word(unit, name, address, payload)
        events.took(unit, said(name))
        return
    before = unit.record.halts_begun
    await send_word(unit, name, *first)
    halted = Unconfirmed(
        f"unit {unit.address} was told to stop when {first[1]} had been sent to {tables.shown(first[0])}, "
        f"which comes before {said(name)}; the rest of it was not sent",
        unit=unit.address,
    )
    if unit.record.halts_begun != before:
        raise halted
    try:
        await send_word(unit, name, address, payload)
    except NotReady as error:
        raise halted from error
    events.took(unit, said(name))


async def send_word(unit: DriveView, name: str, address: int, payload: int | Sequence[int]) -> None:
    """Sends what may move the motor, once. Where nothing is known of it afterwards, that is said."""
    try:
        await raw_words.write(unit, address, payload, judged=name not in _WHATEVER_IT_IS)
    except NotReady as error:
        if error.why != "halted":
            raise
        raise NotReady(
            f"unit {unit.address} was told to stop while {said(name)} was under way, or the port went to another "
            f"program: {said(name)} was not sent. Give it again if it is still wanted",
            why="halted",
            unit=unit.address,
        ) from error
    except LINE_ERRORS as error:
        if error.started is None:
            raise
        raise Unconfirmed(
            f"{said(name)} was sent to unit {unit.address} and not confirmed ({error}); {MAY[name]}. "
            f"{await state_afterwards(unit)}. It was not repeated",
            unit=unit.address,
            **frames_of(error),
        ) from error


def frames_of(error: DrivebusError) -> dict[str, Any]:
    """What an error that is raised because of *error* tells of its frames and their moments."""
    return {"request": error.request, "raw": error.raw, "started": error.started, "ended": error.ended}


async def state_afterwards(unit: DriveView) -> str:
    """The state of *unit* after a command of which nothing is known, in words: as it is read now, or was seen last."""
    try:
        return afterwards(unit, await state.glance(unit))
    except (*LINE_ERRORS, Refused) as error:
        return afterwards(unit, error)


def afterwards(unit: DriveView, seen: Look | Exception) -> str:
    """What *unit* is *seen* to do after a command of which nothing is known, in words; or why it is not."""
    if isinstance(seen, Look):
        return f"State seen afterwards: {seen}"
    return f"Its state could not be read afterwards either ({type(seen).__name__}); {state.seen_last(unit)}"


async def confirm(unit: DriveView, command: str, shows: Callable[[Look], Awaitable[bool]], within: float) -> None:
    """Looks until the drive *shows* the command, for *within* seconds; 0 does not look.

    Raises:
        Unconfirmed: It does not, or is in fault, or the port was lost.
    """
    if within <= 0 or state.planned(unit.evidence).looks.is_blind:
        return
    deadline = unit.bus.now() + within
    while not await _is_shown(unit, command, shows, deadline):
        await unit.bus.sleep(POLL_INTERVAL)


async def _is_shown(unit: DriveView, command: str, shows: Callable[[Look], Awaitable[bool]], deadline: float) -> bool:
    """Whether one look shows the command. Raises `Unconfirmed` where it does not, and another one is not worth it."""
    began = unit.bus.now()
    try:
        seen = await state.glance(unit)
        if await shows(seen):
            return True
        last = f"state seen last: {seen}"
        source = seen.source
        if source not in (ControlSource.COMMUNICATION, None):
            last += f", with commands from the {source}"
        is_over = seen.fault is not None and command != "reset_fault"
        ended = unit.bus.now()
        # What was seen before a long wait for an answer that cannot be mistaken is old: that look is not the last.
        looked_at = ended if ended - began < _LONG_LOOK else began
    except (NoAnswer, BadAnswer, Refused) as error:
        # A refusal here is one of a read: it says nothing about the command.
        last = f"its last answer: {error}; {state.seen_last(unit)}"
        is_over, looked_at = False, unit.bus.now()
    except PortError as error:
        raise Unconfirmed(
            f"{said(command)} was sent to unit {unit.address}; the port was lost before its state showed it "
            f"({error}): {MAY[command]}; {state.seen_last(unit)}. It was not repeated",
            unit=unit.address,
        ) from error
    if not is_over and looked_at < deadline:
        return False
    raise Unconfirmed(
        f"{said(command)} was sent to unit {unit.address}, and its state does not show it: {MAY[command]}; {last}. "
        "It was not repeated",
        unit=unit.address,
    )
