"""The state of a drive at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from drivebus.values.faults import Fault
from drivebus.values.states import ControlSource, State

__all__ = ["Status"]


@dataclass(frozen=True)
class Status:
    """The state of a drive at one moment.

    What the family's status words do not tell is None.

    Attributes:
        state: What it is doing.
        ready: Whether it could run now.
        source: Where it takes its commands from.
        motor: Which motor's data are in force, 1..4.
        overload_alarm: Whether it warns that a motor overload is near.
        frequency: Output frequency in Hz, without a sign: the state tells the direction.
        setpoint: Set frequency in force, in Hz, without a sign.
        fault: The present fault, or None.
        fields: Every field of the status word in the drive's own words.
        time: Unix time in seconds at which the first of it was asked for; 0.0 where nothing was.
        missing: What is not told here, by attribute, and why.
    """

    state: State
    ready: bool | None
    source: ControlSource | None
    motor: int | None
    overload_alarm: bool | None
    frequency: float | None
    setpoint: float | None
    fault: Fault | None
    fields: Mapping[str, str]
    time: float
    missing: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = ["state not told" if "state" in self.missing else str(self.state)]
        if self.frequency is not None or self.setpoint is not None:
            parts.append(f"{_hertz(self.frequency)} of {_hertz(self.setpoint)} Hz")
        if self.ready is not None:
            parts.append("ready" if self.ready else "not ready")
        if self.source is not None:
            parts.append(f"commands from {self.source}")
        if self.overload_alarm:
            parts.append("overload pre-alarm")
        if self.fault is not None:
            parts.append(f"fault {self.fault}")
        elif "fault" in self.missing:
            parts.append("fault not told")
        return ", ".join(parts)


def _hertz(frequency: float | None) -> str:
    return "?" if frequency is None else f"{frequency:.2f}"
