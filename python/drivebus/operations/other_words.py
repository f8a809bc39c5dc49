"""A drive that is set to take other words: what is said where a halt goes out in those, and where nothing can."""

from __future__ import annotations

import warnings
from contextlib import suppress
from typing import NamedTuple

from drivebus.errors import DrivebusWarning, NotAllowed, level_of_the_program
from drivebus.operations import events
from drivebus.operations.drive_view import DriveView

__all__ = ["SetOtherwise", "not_written", "refused", "took"]


class SetOtherwise(NamedTuple):
    """A parameter that gives the words of commands another meaning, as the core tells of it."""

    code: str
    found: int
    wanted: int
    label: str
    means: str
    note: str

    def said(self, unit: DriveView) -> str:
        """What it holds, and what that means."""
        means = f" ({self.means})" if self.means else ", with which its command words may mean something else"
        return f"{self.code} of unit {unit.address} ({unit.profile.title}) is {self.found}{means}"

    @property
    def remedy(self) -> str:
        """What to do."""
        note = f". {self.note}" if self.note else ""
        return f"this profile needs {self.code} = {self.wanted} ({self.label}){note}"


def refused(unit: DriveView, command: str, told: SetOtherwise) -> NotAllowed:
    """Why *command*, which halts, does not go out."""
    return NotAllowed(
        f"{told.said(unit)}: {command} was not sent, for it may start the motor, and no word is known that halts it "
        f"then; {told.remedy.rstrip('.')}. If it must stop now, stop it at the drive, or use the emergency stop",
        unit=unit.address,
    )


def not_written(unit: DriveView, told: SetOtherwise) -> NotAllowed:
    """Why a word that may move the motor does not go out."""
    return NotAllowed(
        f"{told.said(unit)}: nothing was written to it, for the word may move the motor; {told.remedy}",
        unit=unit.address,
    )


def took(unit: DriveView, command: str, word: int, told: SetOtherwise) -> None:
    """Says that *unit* took *word* for *command*: one of the words that it is set to take."""
    text = f"{told.said(unit)}: it was told to {command} by {word:04X}H, which does that then; {told.remedy}"
    events.took_other(unit, text)
    # Where a program makes errors of warnings, a halt is not cut short by what is said of it.
    with suppress(Warning):
        warnings.warn(DrivebusWarning(text), stacklevel=level_of_the_program())
