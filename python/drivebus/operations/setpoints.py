"""What one drive is told besides commands, in engineering units: frequency, torque, PID, limits, analog outputs.

Each is a register that the profile names. A drive that takes it from elsewhere ignores it, so its source is looked at
before; the frequency, whose source a start depends on anyway, goes out at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Coroutine
from typing import TYPE_CHECKING, Any

from drivebus import checks
from drivebus.errors import NotAllowed
from drivebus.operations.control import Controls
from drivebus.values import Value

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["SETPOINTS", "Setpoints"]

SETPOINTS = {
    "torque": "The torque setpoint in percent.",
    "pid": "The PID setpoint in percent.",
    "pid_feedback": "The PID feedback value in percent, where the bus brings it.",
    "forward_limit": "The highest frequency while turning forward, in Hz: under torque control.",
    "reverse_limit": "The highest frequency while turning in reverse, in Hz: under torque control.",
    "motoring_torque_limit": "The highest torque while driving the load, in percent.",
    "braking_torque_limit": "The highest torque while braking the load, in percent.",
    "vf_voltage": "The output voltage under V/F separation, in percent.",
    "analog_output_1": "Analog output 1 in percent.",
    "analog_output_2": "Analog output 2 in percent.",
}
"""Setpoints that are properties of a drive, beside the frequency, with what they are."""


def _sets(setpoint: str) -> Callable[..., Coroutine[Any, Any, None]]:
    async def give(drive: Setpoints, value: float, *, unverified: bool = False) -> None:
        await drive.give(setpoint, value, unverified=unverified)

    give.__name__ = give.__qualname__ = f"set_{setpoint}"
    give.__doc__ = f"{SETPOINTS[setpoint]} As `give`."
    return give


class Setpoints(Controls):
    """Setpoints of one drive."""

    async def ask_setpoint(self, *, unverified: bool = False) -> float:
        """The setpoint last given over the bus, in Hz.

        Raises:
            NotAllowed: The family has none, or not in Hz, or it is not verified. Nothing was sent.
            NoAnswer, BadAnswer, Refused: See each.
        """
        drive = await self.trusting(unverified)._with_setpoint("frequency")
        register = drive._frequency_in_hz()
        return float(await drive.read(register))

    async def set_setpoint(self, hz: float, *, unverified: bool = False) -> None:
        """Gives a setpoint in Hz: changes the speed of a motor that runs.

        Raises:
            NotAllowed: Above the drive's own maximum or out of range, not in Hz with this drive, not verified for the
                family, or another drive answers at this address since the port was opened again; nothing was sent.
            NoAnswer, BadAnswer, PortError: The drive may have taken it all the same, unless the error's `started` is
                None. A confirmation that was lost was cleared up by reading, as `write` does, and that failed too.
            Unconfirmed: The drive shows another setpoint, however often it was written.
            Refused: The drive kept the old one.
        """
        drive = await self.trusting(unverified)._with_setpoint("frequency")
        await drive._write_setpoint(await drive._setpoint_word(hz))

    async def ask(self, setpoint: str, *, unverified: bool = False) -> float:
        """What was given last for *setpoint*, in its own unit. Errors as for `ask_setpoint`."""
        drive = await self.trusting(unverified)._with_setpoint(setpoint)
        return float(await drive.read(drive._setpoint_register(setpoint)))

    async def give(self, setpoint: str, value: float, *, unverified: bool = False) -> None:
        """Gives *value* for *setpoint*, if the drive would heed it. It changes what a motor does that runs.

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
            await self.set_setpoint(value, unverified=unverified)
            return
        drive = await self.trusting(unverified)._with_setpoint(setpoint)
        register = drive._setpoint_register(setpoint)
        planned = drive._plan_write(register, checks.number(setpoint, value, -math.inf), False)
        await drive._check_heeded(setpoint, register)
        await drive._check_now([planned])
        await drive._write_one(planned, False)

    set_torque = _sets("torque")
    set_pid = _sets("pid")
    set_pid_feedback = _sets("pid_feedback")
    set_forward_limit = _sets("forward_limit")
    set_reverse_limit = _sets("reverse_limit")
    set_motoring_torque_limit = _sets("motoring_torque_limit")
    set_braking_torque_limit = _sets("braking_torque_limit")
    set_vf_voltage = _sets("vf_voltage")
    set_analog_output_1 = _sets("analog_output_1")
    set_analog_output_2 = _sets("analog_output_2")

    async def _with_setpoint(self, setpoint: str) -> Self:
        return await self._settled(self._setpoint_register(setpoint))

    def _setpoint_register(self, setpoint: str) -> str:
        if not isinstance(setpoint, str):
            raise NotAllowed(f"setpoint {setpoint!r} is no text; nothing was sent", unit=self.unit)
        register = self.profile.role(f"setpoints.{setpoint}")
        if register is None:
            known = ", ".join(self.profile.setpoint_names())
            raise NotAllowed(
                f"no {setpoint.replace('_', ' ')} setpoint of {self.profile.title} is known"
                f"{f', only {known}' if known else ''}; nothing was sent to unit {self.unit}",
                unit=self.unit,
            )
        return register

    def _frequency_in_hz(self) -> str:
        """The frequency register, if it is in Hz: some families have it in percent or rpm, as they are set."""
        register = self._setpoint_register("frequency")
        unit = self.profile.describe(register).unit
        if unit != "Hz":
            raise NotAllowed(
                f"the setpoint of unit {self.unit} is in {unit or 'a unit that is not known'}, not in Hz; nothing was "
                f"sent. write({register!r}, …) takes it as it is",
                unit=self.unit,
            )
        return register

    async def _write_setpoint(self, word: int) -> None:
        register = self._setpoint_register("frequency")
        await self._write(self.profile.address(register), word, read_back=self.profile.read_back(register))

    async def _setpoint_word(self, hz: float) -> int:
        hz = checks.number("setpoint", hz, 0.0)
        register = self._frequency_in_hz()
        self._evidence.writes(register)
        raw = self.profile.encode(register, hz)
        limit = self.profile.describe(register).high_from
        if limit is not None and self._evidence.unreadable(limit) is None:
            highest: Value = await self.read(limit)
            if hz > highest:
                raise NotAllowed(
                    f"setpoint {hz:g} Hz is above the drive's own maximum, {limit} = {highest:g} Hz; "
                    f"allowed is 0..{highest:g} Hz. No setpoint was sent to unit {self.unit}",
                    unit=self.unit,
                )
        return raw
