"""How fast a motor turns, and how its drive is set to slow it down."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from drivebus.errors import BadAnswer, NoAnswer, Refused
from drivebus.look import STANDSTILL
from drivebus.operations import bus_control, raw_words, registers
from drivebus.operations.drive_view import DriveView
from drivebus.values import State, Value

__all__ = ["Ramp", "frequencies", "output_frequency", "ramp", "turns_in_spite_of"]


class Ramp(NamedTuple):
    """How a drive is set to slow down: in Hz/s, None where that is not known; and whether only the bus tells it to."""

    slope: float | None
    only_by_bus: bool


async def frequencies(unit: DriveView, *, urgent: bool) -> tuple[float | None, float]:
    """Output frequency and setpoint in force, in Hz, in one read; what the family does not tell is None, or inf."""
    names = {role: unit.profile.role(role) for role in ("frequency", "setpoint")}
    known = {role: name for role, name in names.items() if name and unit.evidence.unreadable(name) is None}
    if "frequency" not in known:
        return None, math.inf
    if len({unit.profile.describe(name).unit for name in known.values()}) > 1:
        del known["setpoint"]  # in percent, or rpm
    values = await _told(unit, list(known.values()), urgent=urgent)
    told = {role: abs(float(values[name])) for role, name in known.items()}
    return told["frequency"], told.get("setpoint", math.inf)


async def ramp(unit: DriveView, *, urgent: bool) -> Ramp:
    """How a stop slows the motor down, and who else may, as the drive's parameters say it."""
    time, start = unit.profile.role("deceleration"), unit.profile.role("ramp_start")
    wanted = bus_control.wanted_for(unit, None)
    codes = [row.code for row in wanted]
    readable = unit.evidence.readable([*codes, *(name for name in (time, start) if name)])
    try:
        told = await _told(unit, readable, urgent=urgent)
    except (NoAnswer, BadAnswer, Refused):
        told = {}  # then its standstill has to prove it
    seconds, hz = float(told.get(time or "", 0.0)), float(told.get(start or "", 0.0))
    only_by_bus = bool(wanted) and all(told.get(row.code) == row.value for row in wanted)
    return Ramp(hz / seconds if hz > 0 and seconds > 0 else None, only_by_bus)


async def output_frequency(unit: DriveView, *, urgent: bool = False) -> float | None:
    """The output frequency in Hz, whichever way the motor turns; None where the family does not tell."""
    register = unit.profile.role("frequency")
    if register is None or unit.evidence.unreadable(register) is not None:
        return None
    [word] = await raw_words.read_words(unit, unit.profile.address(register), urgent=urgent)
    return abs(float(registers.value(unit, register, word)))


async def turns_in_spite_of(unit: DriveView, state: State, *, urgent: bool) -> bool:
    """Whether a motor whose *state* says that it rests still turns, in a family whose word may say so on the ramp."""
    if not state.at_rest or not unit.profile.rest_by_frequency():
        return False
    frequency = await output_frequency(unit, urgent=urgent)
    return frequency is not None and frequency > STANDSTILL


async def _told(unit: DriveView, names: Sequence[str], *, urgent: bool) -> dict[str, Value]:
    """What the drive says of *names*, in the fewest requests."""
    if not names:
        return {}
    plan = unit.profile.compile(names)
    answers = [await raw_words.read_words(unit, address, count, urgent=urgent) for address, count in plan.reads]
    return dict(zip(plan.names, plan.values(answers), strict=True))
