"""One command to one drive: sent once, and proved by what the drive's own state says afterwards.

Where the family has no state that may be used, the drive's confirmation of the command is the proof, and its fault
number is looked at.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence

from drivebus.errors import LINE_ERRORS, BadAnswer, NoAnswer, PortError, Refused, Unconfirmed
from drivebus.operations import setpoints, state, words
from drivebus.operations.state import Seen
from drivebus.operations.stop_proof import Fall
from drivebus.operations.unit import Unit
from drivebus.values import ControlSource

__all__ = ["A_WORD", "HALTS", "POLL_INTERVAL", "confirm", "give", "send_once"]

POLL_INTERVAL = 0.02
"""Seconds of the line's clock between two looks at the state."""

_WRITE_MANY = 0x10

A_WORD = "a word that can move the motor"

_MAY = {
    A_WORD: "the motor may turn",
    "run_forward": "the motor may turn",
    "run_reverse": "the motor may turn",
    "jog_forward": "the motor may turn",
    "jog_reverse": "the motor may turn",
    "stop": "the motor may still turn",
    "coast": "the motor may still be fed",
    "jog_stop": "the motor may still turn",
    "reset_fault": "the fault may be reset, and a drive that is still told to run may start",
}
"""What may have happened when a command was sent and nothing is known of it."""

_WHATEVER_IT_IS = ("reset_fault",)
"""Commands that are given to a unit that contradicts its profile too, as those that halt are: whether a drive gets out
of a fault shall not depend on a name. It has shown that fault in the words of the profile."""

HALTS = ("stop", "coast", "jog_stop")
"""Commands that go out at once, even to a drive that seems deaf: it may hear although nothing is heard of it."""


async def give(unit: Unit, name: str, setpoint: int | None = None) -> None:
    """Sends the command word once, with the setpoint behind it where the drive has both side by side."""
    address, code = unit.profile.command(name)
    payload: int | list[int] = code
    if setpoint is not None:
        together = _WRITE_MANY in unit.profile.functions
        if together and unit.profile.address(setpoints.register_of(unit, "frequency")) == address + 1:
            payload = [code, setpoint]
        else:
            await setpoints.write_word(unit, setpoint)
    await send_once(unit, name, address, payload)


async def send_once(unit: Unit, name: str, address: int, payload: int | Sequence[int]) -> None:
    """Sends what may move the motor, once. Where nothing is known of it afterwards, that is said."""
    urgent = name in HALTS
    try:
        if urgent:
            await words.send(unit, address, payload, urgent=True)
            unit.memory.halts += 1
        else:
            await words.write(unit, address, payload, judged=name not in _WHATEVER_IT_IS)
    except LINE_ERRORS as error:
        if error.started is None:
            if not urgent:
                raise
            raise type(error)(
                f"{name} could not be sent to unit {unit.address} ({error}); {_MAY[name]}",
                unit=unit.address,
                request=error.request,
                ended=error.ended,
            ) from error
        unit.memory.halts += urgent
        raise Unconfirmed(
            f"{name} was sent to unit {unit.address} and not confirmed ({error}); {_MAY[name]}. "
            f"{await _state_afterwards(unit, urgent)}. It was not repeated",
            unit=unit.address,
            request=error.request,
            raw=error.raw,
            started=error.started,
            ended=error.ended,
        ) from error


async def _state_afterwards(unit: Unit, urgent: bool) -> str:
    try:
        return f"State seen afterwards: {await state.glance(unit, urgent=urgent)}"
    except (*LINE_ERRORS, Refused) as error:
        return f"Its state could not be read afterwards either ({type(error).__name__}); {state.seen_last(unit)}"


async def confirm(
    unit: Unit, command: str, shows: Callable[[Seen], Awaitable[bool]], within: float, fall: Fall | None = None
) -> None:
    """Looks until the drive *shows* the command, for *within* seconds, and as long as a *fall* is worth a look."""
    if within == 0 or state.planned(unit).plan is None:
        return
    deadline = unit.bus.now() + within
    while True:
        try:
            seen = await state.glance(unit, urgent=command in HALTS and unit.bus.now() <= deadline)
            if await shows(seen):
                return
            last = f"state seen last: {seen}"
            if fall is not None and fall.frequency is not None:
                last += f", at {fall.frequency:g} Hz"
            source = seen.source
            if source not in (ControlSource.COMMUNICATION, None):
                last += f", with commands from the {source}"
            # A motor that was told to stop is looked at: some drives run on in a fault.
            if seen.fault is not None and command not in (*HALTS, "reset_fault"):
                break
        except (NoAnswer, BadAnswer, Refused) as error:
            # A refusal here is one of a read: it says nothing about the command.
            last = f"its last answer: {error}; {state.seen_last(unit)}"
        except PortError as error:
            raise Unconfirmed(
                f"{command} was sent to unit {unit.address}; the port was lost before its state showed it ({error}): "
                f"{_MAY[command]}; {state.seen_last(unit)}. It was not repeated",
                unit=unit.address,
            ) from error
        if unit.bus.now() >= (deadline if fall is None else fall.until):
            break
        await unit.bus.sleep(POLL_INTERVAL)
    raise Unconfirmed(
        f"{command} was sent to unit {unit.address}, and its state does not show it: {_MAY[command]}; {last}. "
        "It was not repeated",
        unit=unit.address,
    )
