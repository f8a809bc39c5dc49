"""How fast a motor turns."""

from __future__ import annotations

from drivebus.operations import glances
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import carried_out_of
from drivebus.values import State

__all__ = ["output_frequency", "turns_in_spite_of"]


async def output_frequency(unit: DriveView) -> float | None:
    """The output frequency in Hz, whichever way the motor turns; None where the family does not tell."""
    asked = glances.planned(unit.evidence).looks.output_frequency(unit.address)
    told: float | None = await carried_out_of(unit, asked)
    return told


async def turns_in_spite_of(unit: DriveView, doing: State) -> bool:
    """Whether a motor that rests as it is *doing* still turns, in a family whose word may say so on the ramp."""
    asked = glances.planned(unit.evidence).looks.turns_in_spite_of(unit.address, doing.value)
    told: bool = await carried_out_of(unit, asked)
    return told
