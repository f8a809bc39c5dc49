"""What is seen of a motor after it was told to stop, and whether that proves that it obeys.

A drive that ramps down says "running" until it stands. That its frequency falls proves nothing: it also falls in a
reversal, at a limit of the current, behind a controller, to a setpoint that was lowered, or while a turning motor is
caught, and each of these may end anywhere or go on through zero. Two things do prove it. One is standstill. The other
is a fall that began when the stop was sent, from the setpoint at which the motor ran, along the ramp that is set in the
drive. Whether anybody else may have told it to slow down is for who asks.
"""

from __future__ import annotations

import math
from typing import NamedTuple

__all__ = ["PATIENCE", "Fall"]

PATIENCE = 1.0
"""Seconds of the line's clock in which the frequency of a motor that stops must fall: even a ramp of an hour takes off
a hundredth of a hertz in that time."""

_LONGEST = 60.0
"""Seconds for which a fall is looked at where the ramp is not known; where it is, half as long again as that takes."""

_LONG_ENOUGH, _FAR_ENOUGH = 0.5, 1.0
"""Seconds and hertz of a ramp that have to be seen."""

_WOBBLE = 0.05
"""Hertz by which the frequency may be off its ramp: some hundredths go up and down where a drive controls its flux."""

_EXCHANGE, _DELAY = 0.1, 0.1
"""Seconds before and after the confirmation of a stop in which its ramp may begin."""

_AT_REST = 0.2
"""Seconds for which a motor that was seen running has to be at rest: one that turns round passes through zero."""


class _Look(NamedTuple):
    """One look at the frequency, which was what it is at some moment between two."""

    asked: float
    answered: float
    hz: float
    setpoint: float


class Fall:
    """What was seen since a stop was sent.

    Args:
        sent: The line's clock before it was.
        confirmed: The line's clock when the drive had confirmed it.
        within: Seconds for which it is looked at in any case.

    Attributes:
        until: Until when it is worth another look.
        frequency: The one seen last, in Hz; None if none was.
        seen_at: When that was.
    """

    def __init__(self, sent: float, confirmed: float, within: float) -> None:
        self.until = self._due = confirmed + within
        self.frequency: float | None = None
        self.seen_at = confirmed
        self._patience = max(PATIENCE, within)
        self._longest = confirmed + _LONGEST
        self._began = max(sent, confirmed - _EXCHANGE), confirmed + _DELAY
        self._lowest = math.inf
        self._went_on = False
        self._rests_since: float | None = None
        self._looks: list[_Look] = []
        self._off = False

    def goes_on(self) -> None:
        """It is not at rest."""
        self._went_on, self._rests_since = True, None

    def rests(self, now: float) -> bool:
        """It is at rest. Whether that is its standstill, and no passage through zero."""
        if self._rests_since is None:
            self._rests_since = now
            self.until = max(self.until, now + 2 * _AT_REST)
        return not self._went_on or now - self._rests_since >= _AT_REST

    def see(self, hz: float, setpoint: float, asked: float, answered: float) -> None:
        """Takes the frequency and the setpoint in force of one look into account, both in Hz."""
        self.frequency, self.seen_at = hz, answered
        if hz < self._lowest and self._looks:
            self.until = max(self._due, min(answered + self._patience, self._longest))
        self._lowest = min(self._lowest, hz)
        self._looks.append(_Look(asked, answered, hz, setpoint))

    def is_worth_asking(self) -> bool:
        """Whether so much of it was seen that it is worth asking the drive for its ramp."""
        return self._seen_for(_LONG_ENOUGH, 2 * _WOBBLE)

    def goes_along(self, slope: float) -> bool:
        """Whether enough was seen, and all of it where a ramp of *slope* Hz/s goes that began with the stop."""
        first = self._looks[0]
        self._longest = max(self._longest, self._began[1] + 1.5 * first.hz / slope)
        if self._off or not self._seen_for(_LONG_ENOUGH, _FAR_ENOUGH):
            return False
        earliest, latest = self._began
        for asked, answered, hz, setpoint in self._looks:
            fallen = setpoint - hz
            self._off |= setpoint != first.setpoint or fallen < -_WOBBLE
            earliest = max(earliest, asked - (fallen + _WOBBLE) / slope)
            if fallen > _WOBBLE:
                latest = min(latest, answered - (fallen - _WOBBLE) / slope)
        self._off = self._off or earliest > latest
        return not self._off

    def _seen_for(self, seconds: float, hz: float) -> bool:
        first, last = self._looks[0], self._looks[-1]
        return last.asked - first.answered >= seconds and first.hz - last.hz >= hz
