"""What one look at a drive shows: its status words, decoded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from drivebus import _native
from drivebus.values import ControlSource, State

if TYPE_CHECKING:
    from drivebus.values import Fault

__all__ = ["STANDSTILL", "Look"]

STANDSTILL = _native.STANDSTILL
"""Output frequency in Hz up to which a drive that has stopped counts as stopped."""


class Look(NamedTuple):
    """The status words of a drive at one moment, decoded, as `Drive.look` reads them.

    Attributes:
        state: What the motor does; `State.UNKNOWN` where the words do not tell.
        fields: The bit fields of the state word, in words, such as `{"ready": "ready"}`.
        fault: What the drive tripped on, or None.
        time: Unix time in seconds at which the first of it was asked for; 0.0 where nothing was.
        missing: What the family's words do not tell, or may not be asked for, and why not.
        in_fault: Whether the state word says that the drive is in fault, or where it cannot, the fault number. It may
            run all the same.
        word: The state word itself, or None.
    """

    state: State
    fields: Mapping[str, str]
    fault: Fault | None
    time: float
    missing: Mapping[str, str]
    in_fault: bool
    word: int | None

    @property
    def source(self) -> ControlSource | None:
        """Where the drive takes its commands from, if its words tell."""
        channel = self.fields.get("control_channel")
        return next((source for source in ControlSource if source.value == channel), None)

    @property
    def tripped(self) -> bool:
        """Whether the drive is in fault: by its state word, or where that is not known by its fault number."""
        return self.in_fault or ("state" in self.missing and self.fault is not None)

    def __str__(self) -> str:
        if "state" in self.missing:
            return f"state not known, {self.fault or ('fault not known' if 'fault' in self.missing else 'no fault')}"
        if self.in_fault and self.state is not State.FAULT:
            return f"{self.state}, in fault: {self.fault or 'not named'}"
        return f"{self.state}, {self.fault}" if self.fault else str(self.state)
