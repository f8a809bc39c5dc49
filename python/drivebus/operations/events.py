"""What happens to a drive, for `logging`: commands that it took, states that changed, faults, and silence.

A change is told once, to the logger `drivebus.drive`. Who never imported `logging` does not want its records.
"""

from __future__ import annotations

import sys

from drivebus.operations.drive_view import DriveView
from drivebus.values import State

__all__ = ["LOGGER", "answered", "failed", "saw", "took", "took_other"]

LOGGER = "drivebus.drive"


def took(unit: DriveView, command: str) -> None:
    """The drive took *command*, as it says."""
    _tell("INFO", unit, f"took {command}")


def took_other(unit: DriveView, text: str) -> None:
    """The drive took a word of another control profile, as *text* says."""
    _tell("WARNING", unit, text)


def saw(unit: DriveView, state: State, fault: str | None) -> None:
    """The drive shows *state*, and *fault* in words where it is in one."""
    record = unit.record
    before, record.shown = record.shown, (state, fault)
    if before is None or before == record.shown:
        return
    if fault is not None and before[1] is None:
        _tell("WARNING", unit, f"in fault: {fault}")
    elif fault is None and before[1] is not None:
        _tell("INFO", unit, f"out of fault: {state}")
    elif state is not before[0]:
        _tell("INFO", unit, f"{before[0]}, now {state}")


def failed(unit: DriveView, why: Exception) -> None:
    """The line failed for the drive."""
    if not unit.record.is_lost:
        unit.record.is_lost = True
        _tell("WARNING", unit, f"lost: {why}")


def answered(unit: DriveView) -> None:
    """The drive answers."""
    if unit.record.is_lost:
        unit.record.is_lost = False
        _tell("INFO", unit, "answers again")


def _tell(level: str, unit: DriveView, text: str) -> None:
    logging = sys.modules.get("logging")
    if logging is not None:
        number = getattr(logging, level)
        logging.getLogger(LOGGER).log(number, "unit %d: %s", unit.address, text, extra={"unit": unit.address})
