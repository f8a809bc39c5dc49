"""What ends a trial early: a bound that is left, too high a current, a fault, somebody else who stops or moves it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivebus.look import Look
from drivebus.trial.setpoint_courses import Course

__all__ = ["Bounds", "Roles"]

_SHARE = 0.25
"""Of the course's width: how far the motor may leave it where nothing else is said."""

_LEAST = 1.0
"""Hz: the least that it may in that case."""

_STEP = 0.011
"""Hz that a setpoint may be off for being counted in hundredths."""


@dataclass(frozen=True)
class Roles:
    """What the family calls the values that are looked at; None for what it does not tell.

    Attributes:
        frequency: The output frequency.
        setpoint: The setpoint in force.
        current: The output current.
    """

    frequency: str
    setpoint: str | None
    current: str | None


@dataclass(frozen=True)
class Bounds:
    """The bounds of one trial.

    Attributes:
        course: Where the setpoint goes.
        roles: What the values are called.
        max_current: The highest output current in A; None for no such bound.
        margin: How far the output frequency may be beyond the course, in Hz.
    """

    course: Course
    roles: Roles
    max_current: float | None
    margin: float

    @staticmethod
    def usual_margin(course: Course) -> float:
        """A quarter of the course's width, and 1 Hz at least."""
        return max(_SHARE * (course.high - course.low), _LEAST)

    def left(self, values: Mapping[str, float], moving: bool) -> str | None:
        """Which bound *values* leave, in words; None for none.

        Args:
            values: What was measured.
            moving: Whether the course has begun; before, the motor comes up from standstill.
        """
        roles, course = self.roles, self.course
        current = values[roles.current] if roles.current else None
        if current is not None and self.max_current is not None and current > self.max_current:
            return f"{roles.current} was {current:g} A, above the {self.max_current:g} A that it was given"
        frequency = values[roles.frequency]
        low = course.low - self.margin if moving else 0.0
        high = course.high + self.margin
        if not low <= frequency <= high:
            return f"{roles.frequency} was {frequency:g} Hz, outside {max(low, 0.0):g} to {high:g} Hz"
        setpoint = values[roles.setpoint] if roles.setpoint else None
        if setpoint is not None and not course.low - _STEP <= setpoint <= course.high + _STEP:
            return (
                f"{roles.setpoint} was {setpoint:g} Hz, outside {course.low:g} to {course.high:g} Hz: somebody else "
                "sets it, or the drive limits it"
            )
        return None

    @staticmethod
    def ended(seen: Look) -> str | None:
        """Why the motor no longer runs as it was told to, by the drive's own state; None while it does."""
        if seen.tripped or seen.fault is not None:
            return f"the drive tripped: {seen.fault or seen.state}"
        if "state" not in seen.missing and not seen.state.running:
            return f"the drive is {seen.state}: somebody else told it to"
        return None
