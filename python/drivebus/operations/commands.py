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
from drivebus.identify.harm import HALTS
from drivebus.look import Look
from drivebus.operations import events, raw_words, setpoints, state
from drivebus.operations.drive_view import DriveView
from drivebus.operations.stop_proof import Fall
from drivebus.values import ControlSource

__all__ = [
    "A_WORD",
    "MAY",
    "POLL_INTERVAL",
    "Proof",
    "confirm",
    "frames_of",
    "prepared",
    "send",
    "send_word",
    "state_afterwards",
]

POLL_INTERVAL = 0.02
"""Seconds of the line's clock between two looks at the state."""

_LONGER_INTERVAL = 0.1
"""The same, where it takes longer than it was given. Each look goes before all who wait, as the stop did."""

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


async def state_afterwards(unit: DriveView, *, urgent: bool = False) -> str:
    """The state of *unit* after a command of which nothing is known, in words: as it is read now, or was seen last."""
    try:
        return f"State seen afterwards: {await state.glance(unit, urgent=urgent)}"
    except (*LINE_ERRORS, Refused) as error:
        return f"Its state could not be read afterwards either ({type(error).__name__}); {state.seen_last(unit)}"


async def confirm(
    unit: DriveView, command: str, shows: Callable[[Look], Awaitable[bool]], within: float, fall: Fall | None = None
) -> None:
    """Looks until the drive *shows* the command, for *within* seconds, and as long as a *fall* is worth a look."""
    proof = Proof(unit, command, shows, within, fall)
    while not await proof.look():
        await unit.bus.sleep(POLL_INTERVAL)


class Proof:
    """The looks at one drive until it shows a command that was sent.

    Args:
        unit: The drive.
        command: What was sent.
        shows: Whether what is seen proves it.
        within: Seconds for which it is looked at; 0 does not look.
        fall: What is seen of its frequency: as long as that is worth a look, it is looked at in any case.
    """

    def __init__(
        self,
        unit: DriveView,
        command: str,
        shows: Callable[[Look], Awaitable[bool]],
        within: float,
        fall: Fall | None = None,
    ) -> None:
        self._unit, self._command, self._shows, self._fall = unit, command, shows, fall
        self._asked = within > 0 and not state.planned(unit.evidence).looks.is_blind
        self._deadline = unit.bus.now() + within

    def wait(self, seconds: float) -> None:
        """For *seconds* others were looked at: they do not count."""
        self._deadline += seconds
        if self._fall is not None:
            self._fall.wait(seconds)

    @property
    def pause(self) -> float:
        """Seconds to the next look: what takes longer than it was given leaves others the line in between."""
        return POLL_INTERVAL if self._unit.bus.now() <= self._deadline else _LONGER_INTERVAL

    async def look(self) -> bool:
        """Looks once. Whether nothing is left to be proved.

        Raises:
            Unconfirmed: It is not proved, and not worth another look.
        """
        if not self._asked:
            return True
        unit, command, fall = self._unit, self._command, self._fall
        began = unit.bus.now()
        try:
            seen = await state.glance(unit, urgent=command in HALTS)
            if await self._shows(seen):
                return True
            last = f"state seen last: {seen}"
            if fall is not None and fall.frequency is not None:
                last += f", at {fall.frequency:g} Hz"
            source = seen.source
            if source not in (ControlSource.COMMUNICATION, None):
                last += f", with commands from the {source}"
            # A motor that was told to stop is looked at: some drives run on in a fault.
            is_over = seen.fault is not None and command not in (*HALTS, "reset_fault")
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
                f"({error}): {MAY[command]}; {state.seen_last(unit)}{_once(command)}",
                unit=unit.address,
            ) from error
        if not is_over and looked_at < (self._deadline if fall is None else fall.until):
            return False
        raise Unconfirmed(
            f"{said(command)} was sent to unit {unit.address}, and its state does not show it: {MAY[command]}; {last}"
            f"{_once(command)}",
            unit=unit.address,
        )


def _once(command: str) -> str:
    """That *command* was sent once, where that is so: a halt is sent until it is taken."""
    return "" if command in HALTS else ". It was not repeated"
