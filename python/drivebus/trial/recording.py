"""Moves the setpoint along a course and records what the drive does, inside the block that stops the motor.

Every request goes out from here, one after the other: what is read is looked at before anything else is written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from drivebus.drive import Drive
from drivebus.trial.abort_rules import Bounds
from drivebus.trial.samples import Samples
from drivebus.trial.setpoint_courses import Course, Wave

__all__ = ["Recording"]

_NEAR = 0.1
"""Hz from the beginning of the course at which the motor has come there."""

_STEADY = 0.5
"""Seconds that it stays there before the course begins."""

_LOOK = 0.2
"""Seconds between two looks at the drive's state."""


class Recording:
    """One run of a motor along a course.

    Args:
        drive: What turns.
        course: Where the setpoint goes.
        bounds: What ends it early.
        names: What is read, again and again.
        told: Is called with each sample: Unix time in seconds, and the values by name.

    Attributes:
        samples: What was read so far.
        aborted: Why it was ended early, or None.
    """

    def __init__(
        self,
        drive: Drive,
        course: Course,
        bounds: Bounds,
        names: Sequence[str],
        told: Callable[[float, Mapping[str, float]], object] | None,
    ) -> None:
        self.samples = Samples(units={name: drive.describe(name).unit for name in names})
        self.aborted: str | None = None
        self._drive = drive
        self._course = course
        self._bounds = bounds
        self._names = names
        self._told = told
        self._looked = 0.0
        # Before anything moves: the drive's own maximum may be lower.
        self._allowed = drive.check_setpoints(course.low, course.high)
        drive.look()

    def run(self, duration: float, settle: float, reverse: bool, force: bool) -> None:
        """Starts the motor, lets it settle, moves the setpoint for *duration* seconds, and stops it by all means.

        Args:
            duration: Seconds of the line's clock from the first change of the setpoint on.
            settle: Seconds that it is given to come to the beginning of the course.
            reverse: Turn the other way.
            force: Start although the link is bad.
        """
        with self._drive.running(self._course.start, reverse=reverse, force=force):
            self._come_to_the_start(settle)
            if self.aborted is None:
                self._follow(duration)
            else:
                self.samples.shift(self.samples.times[0])

    def _come_to_the_start(self, settle: float) -> None:
        bus, start = self._drive.bus, self._course.start
        until, near_since = bus.now() + settle, None
        while self.aborted is None:
            time, values = self._sample(moving=False)
            frequency = values[self._bounds.roles.frequency]
            if abs(frequency - start) > _NEAR + 1e-9:
                near_since = None
                if time > until:
                    self.aborted = f"{start:g} Hz was not reached in {settle:g} s; the output was at {frequency:g} Hz"
                continue
            near_since = time if near_since is None else near_since
            if time - near_since >= _STEADY:
                return

    def _follow(self, duration: float) -> None:
        bus = self._drive.bus
        before = bus.now()
        self._set(self._course.at(0.0))
        # The drive takes it somewhere in that exchange.
        zero = (before + bus.now()) / 2
        moves = isinstance(self._course, Wave)
        try:
            while self.aborted is None:
                time, _ = self._sample(moving=True)
                if time - zero >= duration:
                    return
                if moves and self.aborted is None:
                    self._set(self._course.at(bus.now() - zero))
        finally:
            self.samples.shift(zero)

    def _set(self, hz: float) -> None:
        self._drive.write_setpoint(hz, checked=self._allowed)

    def _sample(self, moving: bool) -> tuple[float, Mapping[str, float]]:
        """Reads all once, keeps and judges it; its moment on the line's clock, and the values."""
        bus = self._drive.bus
        snapshot = self._drive.monitor(*self._names)
        # From when the request left, whoever it waited for before.
        half = snapshot.duration / 2
        time = bus.now() - half
        values = {name: float(snapshot[name]) for name in self._names}
        roles = self._bounds.roles
        # A course has no direction; some families have it in the sign.
        values |= {name: abs(values[name]) for name in (roles.frequency, roles.setpoint) if name in values}
        if not self.samples.times:
            self.samples.began = snapshot.time + half - time
        self.samples.add(time, values)
        if self._told is not None:
            self._told(self.samples.began + time, values)
        self.aborted = self._bounds.left(values, moving)
        if self.aborted is not None or time - self._looked >= _LOOK:
            self._looked = time
            # A motor that tripped leaves its bounds as well: the fault is what is to be told.
            self.aborted = self._bounds.ended(self._drive.look()) or self.aborted
        return time, values
