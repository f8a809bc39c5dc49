"""Each way in which a drive is started by name, or may be: for who names it wrongly."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["STARTS"]

STARTS: dict[str, Callable[[Any], Any]] = {
    "run": lambda drive: drive.run(5.0),
    "run, forced": lambda drive: drive.run(5.0, force=True),
    "run in reverse": lambda drive: drive.run(5.0, reverse=True),
    "run as it was set": lambda drive: drive.run(),
    "jog": lambda drive: drive.jog(),
    "setpoint": lambda drive: setattr(drive, "setpoint", 5.0),
    "reset": lambda drive: drive.reset_fault(),
}
