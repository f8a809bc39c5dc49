"""Errors as the command line tells them: on standard error, in its own words, and as the code that it ends with."""

from __future__ import annotations

import drivebus
from drivebus.advice import Text
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import remark

__all__ = ["exit_code", "tell", "tell_wills"]

_EXIT_CODES: list[tuple[type[drivebus.DrivebusError], int]] = [
    (drivebus.NotAllowed, 2),
    (drivebus.NoAnswer, 3),
    (drivebus.Refused, 4),
    (drivebus.PortError, 5),
    (drivebus.BadAnswer, 6),
    (drivebus.Unconfirmed, 7),
]
"""What the process ends with, by whose fault it is; 0 is done, 1 anything else, such as differences found."""


def exit_code(error: drivebus.DrivebusError | type[drivebus.DrivebusError]) -> int:
    """What the process ends with after *error*, or after one of that kind."""
    given = error if isinstance(error, type) else type(error)
    return next((code for kind, code in _EXIT_CODES if issubclass(given, kind)), 1)


def tell_wills(bus: drivebus.Bus) -> None:
    """Says what was halted on *bus* that nobody here asked for, whatever came of the command."""
    for done in bus.stats().wills:
        remark(done)


def tell(error: drivebus.DrivebusError, about: str = "") -> None:
    """Says *error* on standard error; *about* is what it is the error of, where it was one of several."""
    # Notes say what was done before; Python 3.10 has none.
    for line in (Text(f"Error: {about + ': ' if about else ''}", error.text), *getattr(error, "__notes__", ())):
        remark(in_commands(line))
