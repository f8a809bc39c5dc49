"""What the setpoint does in a trial: where it begins, where it goes, and between which frequencies it stays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from drivebus import checks
from drivebus.errors import BadArgument

__all__ = ["Change", "Course", "Wave"]

_HIGHEST = 3200.0
"""Hz: no drive that is known turns faster."""


class Course(Protocol):
    """A setpoint over time, in Hz. The moment 0 is when it begins to move."""

    @property
    def start(self) -> float:
        """Where the motor settles first."""

    @property
    def low(self) -> float:
        """The lowest setpoint."""

    @property
    def high(self) -> float:
        """The highest setpoint."""

    def at(self, seconds: float) -> float:
        """The setpoint so many seconds after the moment 0."""


@dataclass(frozen=True)
class Change:
    """From one frequency to another, at once: how fast the motor follows is the drive's affair.

    Raises:
        NotAllowed: One of them is no frequency, or both are the same.
    """

    start: float
    to: float

    def __post_init__(self) -> None:
        for name in ("start", "to"):
            checks.number(name, getattr(self, name), 0.0, _HIGHEST)
        if self.start == self.to:
            raise BadArgument(f"from {self.start:g} Hz to {self.to:g} Hz is no change; nothing was sent")

    @property
    def low(self) -> float:
        """The lower of the two."""
        return min(self.start, self.to)

    @property
    def high(self) -> float:
        """The higher of the two."""
        return max(self.start, self.to)

    def at(self, seconds: float) -> float:  # noqa: ARG002 - it stays there
        """Where it goes."""
        return self.to


@dataclass(frozen=True)
class Wave:
    """Up and down between two frequencies, from the middle upwards, as a sine of so many seconds.

    Raises:
        NotAllowed: One of them is no frequency, the first is not below the second, or the period is no time.
    """

    low: float
    high: float
    period: float

    def __post_init__(self) -> None:
        checks.number("low", self.low, 0.0, _HIGHEST)
        checks.number("high", self.high, 0.0, _HIGHEST)
        checks.number("period", self.period, 0.1, 3600.0)
        if self.low >= self.high:
            raise BadArgument(f"{self.low:g} Hz is not below {self.high:g} Hz; nothing was sent")

    @property
    def start(self) -> float:
        """The middle."""
        return (self.low + self.high) / 2

    def at(self, seconds: float) -> float:
        """Never beyond either of the two."""
        asked = self.start + (self.high - self.low) / 2 * math.sin(2 * math.pi * seconds / self.period)
        return min(max(asked, self.low), self.high)
