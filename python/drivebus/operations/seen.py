"""What was seen of a unit after something came to nothing, in words, and what its error tells of its frames."""

from __future__ import annotations

from typing import Any

from drivebus.errors import DrivebusError
from drivebus.look import Look
from drivebus.operations import glances
from drivebus.operations.drive_view import DriveView

__all__ = ["afterwards", "frames_of"]


def frames_of(error: DrivebusError) -> dict[str, Any]:
    """What an error that is raised because of *error* tells of its frames and their moments."""
    return {"request": error.request, "raw": error.raw, "started": error.started, "ended": error.ended}


def afterwards(unit: DriveView, seen: Look | Exception, found: float | None = None) -> str:
    """What *unit* is *seen* to do after a command of which nothing is known, in words; or why it is not.

    That was *found* just now, or at this moment of the line's clock.
    """
    if isinstance(seen, Look):
        return f"State seen afterwards: {seen}"
    return f"Its state could not be read afterwards either ({type(seen).__name__}); {glances.seen_last(unit, found)}"
