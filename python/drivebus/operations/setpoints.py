"""What one drive is told besides commands, in engineering units: frequency, torque, PID, limits, analog outputs.

Each is a register that the profile names. A drive that takes it from elsewhere ignores it, so its source is looked at
before; the frequency, whose source a start depends on anyway, goes out at once.
"""

from __future__ import annotations

import math

from drivebus import checks
from drivebus.errors import BadArgument
from drivebus.operations import control, parameters, registers, sending, variants, words
from drivebus.operations.unit import Unit
from drivebus.values import Value

__all__ = [
    "read_setpoint",
    "register_of",
    "with_setpoint",
    "word_of",
    "write_setpoint",
    "write_word",
]


async def read_setpoint(unit: Unit, name: str = "frequency", *, unverified: bool = False) -> float:
    """Reads the setpoint last given over the bus: the frequency in Hz, or another in the unit of its register.

    Args:
        name: One of the family's `Profile.setpoint_names()`, such as `"torque"`.
        unverified: Also where that is not verified for the family.

    Raises:
        NotAllowed: The family has no such setpoint, it can only be written, the frequency is not counted in Hz, or it
            is not verified. Nothing was sent.
        NoAnswer, BadAnswer, Refused, PortError: The drive was only asked; nothing changed.
    """
    unit = await with_setpoint(unit.trusting(unverified), name)
    register = _frequency_in_hz(unit) if name == "frequency" else register_of(unit, name)
    return float(await registers.read(unit, register))


async def write_setpoint(unit: Unit, value: float, name: str = "frequency", *, unverified: bool = False) -> None:
    """Gives a setpoint, the frequency or another, if the drive would follow it. A running motor follows it at once.

    Whether the drive takes the frequency over the bus is not looked at: a start depends on that, and looks at it.

    Args:
        value: In Hz for the frequency, else in the unit of its register (`describe`): percent or Hz.
        name: One of the family's `Profile.setpoint_names()`, such as `"torque"`.
        unverified: Also where that is not verified for the family.

    Raises:
        NotAllowed: The drive takes it from elsewhere (the message lists what must be set, and
            `prepare_control(setpoint=…)` sets it); above the drive's own maximum, out of range, not verified, or
            unknown; the frequency is not counted in Hz; or another drive answers at this address since the port was
            opened again. Nothing was sent.
        NoAnswer, BadAnswer, PortError: The drive may have taken it all the same, unless the error's `started` is
            None. A confirmation that was lost was cleared up by reading, as `write` does, and that failed too.
        Unconfirmed: The drive shows another setpoint, however often it was written.
        Refused: The drive kept the old one.
    """
    unit = await with_setpoint(unit.trusting(unverified), name)
    if name == "frequency":
        await write_word(unit, await word_of(unit, value))
        return
    register = register_of(unit, name)
    planned = parameters.plan_write(unit, register, checks.number(name, value, -math.inf), False)
    await control.check_heeded(unit, name, register)
    await parameters.check_now(unit, [planned])
    await sending.write(unit, [planned], False)


async def with_setpoint(unit: Unit, setpoint: str) -> Unit:
    """The same unit, with everything fixed on which the meaning of *setpoint* depends."""
    return await variants.settled(unit, register_of(unit, setpoint))


def register_of(unit: Unit, setpoint: str) -> str:
    """The register of *setpoint*. Raises `NotAllowed` where the family has none that is known."""
    if not isinstance(setpoint, str):
        raise BadArgument(
            f"a setpoint is named by a text, and {checks.shown(setpoint)} is not one; nothing was sent",
            unit=unit.address,
        )
    register = unit.profile.role(f"setpoints.{setpoint}")
    if register is None:
        known = ", ".join(unit.profile.setpoint_names())
        raise BadArgument(
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
        raise BadArgument(
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
            raise BadArgument(
                f"setpoint {hz:g} Hz is above the drive's own maximum, {limit} = {highest:g} Hz; "
                f"allowed is 0 to {highest:g} Hz. No setpoint was sent to unit {unit.address}",
                unit=unit.address,
            )
    return raw
