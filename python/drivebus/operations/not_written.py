"""Why a write did not go out or was not taken, in words; the core has the kind of the reason."""

from __future__ import annotations

from typing import Any

from drivebus.errors import DrivebusError
from drivebus.operations.aim import harmed
from drivebus.operations.drive_view import DriveView

__all__ = ["in_words"]


def in_words(unit: DriveView, kind: str, told: Any) -> DrivebusError:
    """The error of a write to *unit*: of *kind*, and what is *told* of it, as `_native.Unit.write` has them."""
    if kind == "not_same":
        return unit.identity.not_same(*told)
    if kind == "harm":
        return harmed(unit, *told)
    error: DrivebusError = told
    return error
