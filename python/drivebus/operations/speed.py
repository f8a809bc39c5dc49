"""How fast a motor turns, and how its drive is set to slow it down."""

from __future__ import annotations

import math
from typing import NamedTuple

from drivebus.operations import raw_words, state
from drivebus.operations.drive_view import DriveView
from drivebus.values import State

__all__ = ["Ramp", "frequencies", "output_frequency", "ramp", "turns_in_spite_of"]


class Ramp(NamedTuple):
    """How a drive is set to slow down: in Hz/s, None where that is not known; and whether only the bus tells it to."""

    slope: float | None
    only_by_bus: bool


async def frequencies(unit: DriveView, *, urgent: bool) -> tuple[float | None, float]:
    """Output frequency and setpoint in force, in Hz, in one read; what the family does not tell is None, or inf."""
    told = await raw_words.carried_out_of(unit, state.planned(unit.evidence).looks.frequencies(unit.address, urgent))
    if told is None:
        return None, math.inf
    frequency, setpoint = told
    return frequency, math.inf if setpoint is None else setpoint


async def ramp(unit: DriveView, *, urgent: bool) -> Ramp:
    """How a stop slows the motor down, and who else may, as the drive's parameters say it."""
    told = await raw_words.carried_out_of(unit, state.planned(unit.evidence).looks.ramp(unit.address, urgent))
    return Ramp(*told)


async def output_frequency(unit: DriveView, *, urgent: bool = False) -> float | None:
    """The output frequency in Hz, whichever way the motor turns; None where the family does not tell."""
    asked = state.planned(unit.evidence).looks.output_frequency(unit.address, urgent)
    told: float | None = await raw_words.carried_out_of(unit, asked)
    return told


async def turns_in_spite_of(unit: DriveView, doing: State, *, urgent: bool) -> bool:
    """Whether a motor that rests as it is *doing* still turns, in a family whose word may say so on the ramp."""
    asked = state.planned(unit.evidence).looks.turns_in_spite_of(unit.address, doing.value, urgent)
    told: bool = await raw_words.carried_out_of(unit, asked)
    return told
