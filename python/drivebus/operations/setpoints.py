"""What one drive is told besides commands, in engineering units: frequency, torque, PID, limits, analog outputs.

Each is a register that the profile names. A drive that takes it from elsewhere ignores it, so its source is looked at
before; the frequency, whose source a start depends on anyway, goes out at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from drivebus import _native, checks
from drivebus.errors import BadArgument, DrivebusError
from drivebus.operations import (
    bus_control,
    not_kept,
    not_written,
    registers,
    unit_variants,
)
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.profile import Profile
from drivebus.profile.evidence import refusal_of

__all__ = [
    "SetpointRange",
    "check_setpoints",
    "not_set",
    "read_setpoint",
    "register_of",
    "with_setpoint",
    "write_setpoint",
]


class SetpointRange(NamedTuple):
    """Frequency setpoints that one drive takes, from *low* to *high* Hz, as `Drive.check_setpoints` found out.

    Attributes:
        address: The drive's address.
        low: The lowest, in Hz.
        high: The highest, in Hz.
        profile: What the drive's words mean, as it is set.
    """

    address: int
    low: float
    high: float
    profile: Profile

    def nearest(self, hz: float) -> float:
        """The frequency nearest to *hz* that the drive can count.

        Raises:
            NotAllowed: It is not from `low` to `high`.
        """
        register = self._register
        described = self.profile.describe(register)
        return float(self.profile.decode(register, round(self._within(hz) * described.scale)))

    def word_of(self, hz: float) -> int:
        """*hz*, or what is nearest to it, as the drive counts it. Errors as of `nearest`."""
        return self.profile.encode(self._register, self.nearest(hz))

    @property
    def _register(self) -> str:
        return self.profile.role("setpoints.frequency") or ""

    def _within(self, hz: float) -> float:
        hz = checks.number("setpoint", hz, 0.0)
        if not self.low <= hz <= self.high:
            raise BadArgument(
                f"a setpoint of {hz:g} Hz was not checked: allowed is {self.low:g} to {self.high:g} Hz. No setpoint "
                f"was sent to unit {self.address}",
                unit=self.address,
            )
        return hz


async def read_setpoint(unit: DriveView, name: str = "frequency", *, unverified: bool = False) -> float:
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


async def check_setpoints(unit: DriveView, low: float, high: float, *, unverified: bool = False) -> SetpointRange:
    """Asks the drive once whether it takes frequency setpoints from *low* to *high*. None is sent.

        allowed = drive.check_setpoints(10.0, 30.0)
        drive.write_setpoint(12.3456, checked=allowed)      # one request; the nearest that the drive can count

    Args:
        low: In Hz, from 0.
        high: In Hz, up to the drive's own maximum.
        unverified: Also where the setpoint is not verified for the family.

    Raises:
        NotAllowed: Above the drive's own maximum, out of range, not verified, or not counted in Hz.
        NoAnswer, BadAnswer, Refused, PortError: The drive was only asked; nothing changed.
    """
    unit = await with_setpoint(unit.trusting(unverified), "frequency")
    if checks.number("low", low, 0.0) > checks.number("high", high, 0.0):
        raise BadArgument(
            f"setpoints from {low:g} to {high:g} Hz are none; give the lower one first", unit=unit.address
        )
    _counted(unit, low)
    await _asked_for(unit, high, lambda core: core.frequency_word(high))
    return SetpointRange(unit.address, low, high, unit.profile)


async def write_setpoint(
    unit: DriveView,
    value: float,
    name: str = "frequency",
    *,
    checked: SetpointRange | None = None,
    unverified: bool = False,
) -> None:
    """Gives a setpoint, the frequency or another, if the drive would follow it. A running motor follows it at once.

    Whether the drive takes the frequency over the bus is not looked at: a start depends on that, and looks at it.

    Args:
        value: In Hz for the frequency, else in the unit of its register (`describe`): percent or Hz.
        name: One of the family's `Profile.setpoint_names()`, such as `"torque"`.
        checked: What `check_setpoints` gave for this drive: it is not asked again for its maximum, and a frequency
            between two that it counts goes to the nearest.
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
    unit = unit.trusting(unverified)
    if checked is not None:
        await _write_word(_as_checked(unit, name, checked), checked.word_of(value))
        return
    if name == "frequency":
        hz = checks.number("setpoint", value, 0.0)
        await _asked_for(unit, hz, lambda core: core.set_frequency(hz))
        return
    register = register_of(unit, name)
    value = checks.number(name, value, -math.inf)
    kind, told = await call_core(unit, lambda core: _native.Values(core).give_setpoint(name, value))
    if kind != "done":
        raise _not_given(unit, name, register, *told)


def _not_given(unit: DriveView, name: str, register: str, kind: str, told: Any) -> DrivebusError:
    """Why *unit* was not given a setpoint: *kind* and *told* as `_native.Values.give_setpoint` has them."""
    if kind == "ignored":
        return bus_control.ignored(unit, name, register, told)
    return not_kept.in_words(unit, *told)


def _as_checked(unit: DriveView, name: str, checked: SetpointRange) -> DriveView:
    """The same unit, as it was set when its setpoints were *checked*. Raises `NotAllowed` where another was."""
    if not isinstance(checked, SetpointRange):
        raise BadArgument(
            f"checked takes what check_setpoints gave, and was given {checks.shown(checked)}; nothing was sent",
            unit=unit.address,
        )
    if name != "frequency" or (checked.address, checked.profile.name) != (unit.address, unit.profile.name):
        raise BadArgument(
            f"the frequency of unit {checked.address}, {checked.profile.title}, was checked, and not the {name} of "
            f"unit {unit.address}, {unit.profile.title}; nothing was sent",
            unit=unit.address,
        )
    unit.evidence.require_writable(register_of(unit, name))
    return unit.with_profile(checked.profile)


async def with_setpoint(unit: DriveView, setpoint: str) -> DriveView:
    """The same unit, with everything fixed on which the meaning of *setpoint* depends."""
    return await unit_variants.settled(unit, register_of(unit, setpoint))


def register_of(unit: DriveView, setpoint: str) -> str:
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


def _frequency_in_hz(unit: DriveView) -> str:
    """The frequency register, if it is in Hz: some families have it in percent or rpm, as they are set."""
    register = register_of(unit, "frequency")
    counted_in = unit.profile.describe(register).unit
    if counted_in != "Hz":
        raise _not_in_hz(unit, register, counted_in)
    return register


def _not_in_hz(unit: DriveView, register: str, counted_in: str) -> BadArgument:
    return BadArgument(
        f"the setpoint of unit {unit.address} is in {counted_in or 'a unit that is not known'}, not in Hz; "
        f'nothing was sent. write("{register}", …) takes it as it is',
        unit=unit.address,
    )


async def _write_word(unit: DriveView, word: int) -> None:
    """Writes the frequency, as the drive counts it."""
    kind, told = await call_core(unit, lambda core: core.write_frequency(word))
    if kind != "done":
        raise not_written.in_words(unit, *told)


async def _asked_for(unit: DriveView, hz: float, wanted: Callable[[_native.Unit], _native.Task]) -> None:
    """Does what is *wanted* with *hz*. Raises the errors of a frequency that may not be given, or was not taken."""
    kind, told = await call_core(unit, wanted)
    if kind != "done":
        raise not_set(unit, hz, *told)


def not_set(unit: DriveView, hz: float, kind: str, told: Any) -> DrivebusError:
    """Why *unit* was not given the frequency *hz*: as `_native.Unit.set_frequency` has it."""
    if kind == "not_settled":
        return unit_variants.not_settled(unit, *told)
    if kind == "not_written":
        return not_written.in_words(unit, *told)
    if kind == "above":
        limit, highest = told
        return BadArgument(
            f"setpoint {hz:g} Hz is above the drive's own maximum, {limit} = {highest:g} Hz; "
            f"allowed is 0 to {highest:g} Hz. No setpoint was sent to unit {unit.address}",
            unit=unit.address,
        )
    if kind == "no_register":
        return refusal_of(register_of, unit, "frequency")
    register = register_of(unit, "frequency")
    if kind == "not_in_hz":
        return _not_in_hz(unit, register, told)
    return refusal_of(unit.evidence.require_writable, register)


def _counted(unit: DriveView, hz: float) -> int:
    """*hz* as the drive counts it, as far as the profile tells whether it may be sent."""
    hz = checks.number("setpoint", hz, 0.0)
    register = _frequency_in_hz(unit)
    unit.evidence.require_writable(register)
    return unit.profile.encode(register, hz)
