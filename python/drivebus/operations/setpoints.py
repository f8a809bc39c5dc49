"""What one drive is told besides commands, in engineering units: frequency, torque, PID, limits, analog outputs.

Each is a register that the profile names. A drive that takes it from elsewhere ignores it, so its source is looked at
before; the frequency, whose source a start depends on anyway, goes out at once.
"""

from __future__ import annotations

import math
from collections.abc import Coroutine
from typing import Any, Protocol

from drivebus import checks
from drivebus.errors import NotAllowed
from drivebus.operations import control, parameters, registers, sending, variants, words
from drivebus.operations.unit import Unit
from drivebus.values import Value

__all__ = [
    "SETPOINTS",
    "ask",
    "ask_setpoint",
    "give",
    "register_of",
    "set_setpoint",
    "setter",
    "with_setpoint",
    "word_of",
    "write_word",
]

SETPOINTS = {
    "torque": "The torque setpoint in percent.",
    "pid": "The PID setpoint in percent.",
    "pid_feedback": "The PID feedback value in percent, if it comes over the bus.",
    "forward_limit": "The highest frequency while turning forward, in Hz: under torque control.",
    "reverse_limit": "The highest frequency while turning in reverse, in Hz: under torque control.",
    "motoring_torque_limit": "The highest torque while driving the load, in percent.",
    "braking_torque_limit": "The highest torque while braking the load, in percent.",
    "vf_voltage": "The output voltage under V/F separation, in percent.",
    "analog_output_1": "Analog output 1 in percent.",
    "analog_output_2": "Analog output 2 in percent.",
}
"""Setpoints that are properties of a drive, beside the frequency, with what they are."""


class Setter(Protocol):
    """Gives one setpoint its value."""

    def __call__(self, unit: Unit, value: float, *, unverified: bool = False) -> Coroutine[Any, Any, None]: ...


def setter(setpoint: str) -> Setter:
    """The operation that gives *setpoint*, and nothing else, its value."""

    async def set_it(unit: Unit, value: float, *, unverified: bool = False) -> None:
        await give(unit, setpoint, value, unverified=unverified)

    set_it.__name__ = set_it.__qualname__ = f"set_{setpoint}"
    set_it.__doc__ = f"{SETPOINTS[setpoint]} As `give`."
    return set_it


async def ask_setpoint(unit: Unit, *, unverified: bool = False) -> float:
    """The setpoint last given over the bus, in Hz.

    Raises:
        NotAllowed: The family has none, or not in Hz, or it is not verified. Nothing was sent.
        NoAnswer, BadAnswer, Refused: See each.
    """
    unit = await with_setpoint(unit.trusting(unverified), "frequency")
    register = _frequency_in_hz(unit)
    return float(await registers.read(unit, register))


async def set_setpoint(unit: Unit, hz: float, *, unverified: bool = False) -> None:
    """Gives a setpoint in Hz: changes the speed of a motor that runs.

    Raises:
        NotAllowed: Above the drive's own maximum or out of range, not in Hz with this drive, not verified for the
            family, or another drive answers at this address since the port was opened again; nothing was sent.
        NoAnswer, BadAnswer, PortError: The drive may have taken it all the same, unless the error's `started` is
            None. A confirmation that was lost was cleared up by reading, as `write` does, and that failed too.
        Unconfirmed: The drive shows another setpoint, however often it was written.
        Refused: The drive kept the old one.
    """
    unit = await with_setpoint(unit.trusting(unverified), "frequency")
    await write_word(unit, await word_of(unit, hz))


async def ask(unit: Unit, setpoint: str, *, unverified: bool = False) -> float:
    """Reads the value that was given last for *setpoint*, in its own unit. Errors as for `ask_setpoint`."""
    unit = await with_setpoint(unit.trusting(unverified), setpoint)
    return float(await registers.read(unit, register_of(unit, setpoint)))


async def give(unit: Unit, setpoint: str, value: float, *, unverified: bool = False) -> None:
    """Writes *value* to *setpoint*, if the drive would follow it. A running motor follows it at once.

    Args:
        setpoint: One of the family's `Profile.setpoint_names()`, such as `"torque"`.
        value: In the unit of its register (`describe`): percent or Hz.
        unverified: Also where that is not verified for the family.

    Raises:
        NotAllowed: The drive takes it from elsewhere (the message lists what must be set, and
            `prepare_control(setpoint=…)` sets it); out of range, not verified, or unknown; or another drive answers
            at this address. Nothing was sent.
        NoAnswer, BadAnswer, PortError, Refused, Unconfirmed: As for `set_setpoint`.
    """
    if setpoint == "frequency":
        await set_setpoint(unit, value, unverified=unverified)
        return
    unit = await with_setpoint(unit.trusting(unverified), setpoint)
    register = register_of(unit, setpoint)
    planned = parameters.plan_write(unit, register, checks.number(setpoint, value, -math.inf), False)
    await control.check_heeded(unit, setpoint, register)
    await parameters.check_now(unit, [planned])
    await sending.write(unit, [planned], False)


async def with_setpoint(unit: Unit, setpoint: str) -> Unit:
    """The same unit, with everything fixed on which the meaning of *setpoint* depends."""
    return await variants.settled(unit, register_of(unit, setpoint))


def register_of(unit: Unit, setpoint: str) -> str:
    """The register of *setpoint*. Raises `NotAllowed` where the family has none that is known."""
    if not isinstance(setpoint, str):
        raise NotAllowed(
            f"a setpoint is named by a text, and {checks.shown(setpoint)} is not one; nothing was sent",
            unit=unit.address,
        )
    register = unit.profile.role(f"setpoints.{setpoint}")
    if register is None:
        known = ", ".join(unit.profile.setpoint_names())
        raise NotAllowed(
            f"no {setpoint.replace('_', ' ')} setpoint of {unit.profile.title} is known"
            f"{f', only {known}' if known else ''}; nothing was sent to unit {unit.address}",
            unit=unit.address,
        )
    return register


def _frequency_in_hz(unit: Unit) -> str:
    """The frequency register, if it is in Hz: some families have it in percent or rpm, as they are set."""
    register = register_of(unit, "frequency")
    counted_in = unit.profile.describe(register).unit
    if counted_in != "Hz":
        raise NotAllowed(
            f"the setpoint of unit {unit.address} is in {counted_in or 'a unit that is not known'}, not in Hz; "
            f'nothing was sent. write("{register}", …) takes it as it is',
            unit=unit.address,
        )
    return register


async def write_word(unit: Unit, word: int) -> None:
    """Writes the frequency, as the drive counts it."""
    register = register_of(unit, "frequency")
    read_back = unit.profile.read_back(register)
    await words.write(unit, unit.profile.address(register), word, read_back=read_back, absolute=True)


async def word_of(unit: Unit, hz: float) -> int:
    """*hz* as the drive counts it, if that is no more than its own maximum."""
    hz = checks.number("setpoint", hz, 0.0)
    register = _frequency_in_hz(unit)
    unit.evidence.writes(register)
    raw = unit.profile.encode(register, hz)
    limit = unit.profile.describe(register).high_from
    if limit is not None and unit.evidence.unreadable(limit) is None:
        highest: Value = await registers.read(unit, limit)
        if hz > highest:
            raise NotAllowed(
                f"setpoint {hz:g} Hz is above the drive's own maximum, {limit} = {highest:g} Hz; "
                f"allowed is 0 to {highest:g} Hz. No setpoint was sent to unit {unit.address}",
                unit=unit.address,
            )
    return raw
