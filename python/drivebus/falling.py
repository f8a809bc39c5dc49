"""A frequency that falls after a motor was told to stop, and whether only the stop explains that.

A drive that ramps down says "running" until it stands, so the fall of its frequency is what there is to see of a stop
that works. But a frequency falls as well to a setpoint that was lowered, or to the jog frequency after a jog that
caught a motor which turned. Below that, only a stop explains it; above it, it is looked at for as long as it falls.
"""

from __future__ import annotations

import math

__all__ = ["PATIENCE", "Fall"]

PATIENCE = 1.0
"""Seconds of the line's clock in which the frequency of a motor that stops must fall: even a ramp of an hour takes off
a hundredth of a hertz in that time."""

_LONGEST = 60.0
"""Seconds for which a fall is looked at that another reason may have."""


_WOBBLE = 0.1
"""Hertz by which the output frequency of a motor at its speed goes up and down where the drive controls torque or flux:
a fall by less proves nothing."""


class Fall:
    """What was seen of one.

    Args:
        now: The line's clock.
        within: Seconds for which it is looked at in any case.

    Attributes:
        until: Until when it is worth another look.
        frequency: The one seen last, in Hz; None if none was.
    """

    def __init__(self, now: float, within: float) -> None:
        self.until = self._due = now + within
        self.frequency: float | None = None
        self._longest = now + _LONGEST
        self._first: float | None = None
        self._lowest = math.inf

    def is_overdue(self, now: float) -> bool:
        """Whether it is looked at beyond its time: others who wait for the line then have their turn."""
        return now > self._due

    def began_above(self, hz: float) -> bool:
        """Whether it was *hz* or more at the first look."""
        return self._first is not None and self._first >= hz

    def see(self, hz: float, now: float) -> None:
        """Takes one look into account."""
        self.frequency = hz
        if self._first is None:
            self._first = hz
        elif hz < self._lowest:
            self.until = max(self._due, min(now + PATIENCE, self._longest))
        self._lowest = min(self._lowest, hz)

    def proves(self, held: float) -> bool:
        """Whether it fell, and well below *held*, at which a motor that is not stopped would stay."""
        return self._first is not None and self._lowest < min(self._first, held) - _WOBBLE
