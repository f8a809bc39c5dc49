"""What the drive is told, from what the pins ask and what the drive shows: no clock, no line, no HAL.

Each command is decided once, at the change that asks for it. A start is a change from off to on: whatever ended a run
(the machine switched off, a fault, a lost link, a refusal), `spindle-on` must be seen off before the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from drivebus.hal.pins import Asked
from drivebus.look import STANDSTILL
from drivebus.values import State

__all__ = ["Action", "Coast", "Course", "Reset", "Run", "Scale", "Shown", "Speed", "Spindle", "Stop"]

PATIENCE = 3.0
"""Seconds for which the frequency of a motor that was told to stop may stay as it is."""

ENDED_BY_ITSELF = 1.0
"""Seconds at rest after which a run counts as ended by others. A drive that turns round may rest for a moment."""


class Course(NamedTuple):
    """How the motor is to turn: the frequency as the drive counts it, and which way."""

    word: int
    reverse: bool


class Run(NamedTuple):
    """Starts the motor, or turns it round."""

    course: Course


class Speed(NamedTuple):
    """Gives a running motor another frequency."""

    word: int


class Stop(NamedTuple):
    """Stops the motor as the drive is set to stop it."""


class Coast(NamedTuple):
    """Takes the voltage off a motor that does not heed a stop."""


class Reset(NamedTuple):
    """Resets the drive's fault."""


Action = Run | Speed | Stop | Coast | Reset


class Shown(NamedTuple):
    """What the drive showed, at a moment of the line's clock."""

    time: float
    state: State = State.UNKNOWN
    frequency: float | None = None
    fault: int = 0
    tripped: bool = False
    ready: bool | None = None
    current: float | None = None
    quality: float = 1.0

    @property
    def stands(self) -> bool:
        """Whether the motor is not fed, as far as the drive tells."""
        told = self.state.at_rest or (self.state is State.UNKNOWN and self.frequency is not None)
        return told and (self.frequency is None or abs(self.frequency) <= STANDSTILL)


@dataclass(frozen=True)
class Scale:
    """From the speed of the spindle to the frequency of the drive.

    Attributes:
        rpm_per_hz: Turns of the spindle per minute for each hertz: 60 for a motor of two poles without a gear.
        max_rpm: The highest speed that the drive is told; faster ones are cut to it.
        tolerance: The share of the wanted speed by which a spindle at speed may be off.
    """

    rpm_per_hz: float
    max_rpm: float = math.inf
    tolerance: float = 0.02


class Spindle:
    """One drive as a spindle.

    Args:
        scale: From rpm to Hz.
        patience: Seconds without an answer after which the link counts as lost.

    Attributes:
        counts: What the drive counts for one hertz.
        told: What the motor was told last; None: to stop, or nothing yet.
        trouble: Why this component reports a fault of its own; empty for none.
        errors: How many calls of the drive failed.
        hours: How long the motor has turned, as far as it was seen.
    """

    def __init__(self, scale: Scale, patience: float = 1.0) -> None:
        self._scale = scale
        self._patience = patience
        self.counts = 100.0
        self.told: Course | None = None
        self.trouble = ""
        self.errors = 0
        self.hours = 0.0
        self._look: Shown | None = None
        self._seen_off = False
        self._wanted: Course | None = None
        self._refused: int | None = None
        self._reset_before = True
        self._reset_due = False
        self._rests_since: float | None = None
        self._over = ""
        self._is_fresh = False
        self._not_heard = False
        self._falling: tuple[float, float] | None = None

    def decide(self, now: float, asked: Asked) -> Action | None:
        """What the drive is to be told now, if anything. Who carries it out says `done` or `failed`."""
        request = self._request(asked)
        if request is None:
            self._seen_off = True
        elif not asked.enable:
            self._seen_off = False
        self._wanted = request if asked.enable else None
        self._reset_due |= asked.reset and not self._reset_before
        self._reset_before = asked.reset
        return self._while_off(now) if self.told is None else self._while_on(now, self.told)

    def done(self, action: Action, now: float) -> None:
        """The drive took *action*."""
        self._is_fresh = False
        if isinstance(action, Run):
            self.told, self.trouble, self._over = action.course, "", ""
            self._refused = self._falling = None
            self._rests_since, self._not_heard = None, False
        elif isinstance(action, Speed) and self.told is not None:
            self.told = Course(action.word, self.told.reverse)
        elif isinstance(action, (Stop, Coast)):
            self.told, self._not_heard = None, False
            self._falling = (math.inf, now) if isinstance(action, Stop) else None

    def failed(self, action: Action, why: str, *, final: bool = False, sent: bool = False) -> None:
        """The drive did not take *action*; *final*: nor would it later. *sent*: it may have, for all that is known."""
        self.errors += 1
        self._is_fresh = False
        if isinstance(action, Speed):
            self._refused = action.word if final else None
            return
        self.trouble = why
        if isinstance(action, Run) and self.told is not None:
            self._over = why
            return
        self.told = None
        self._not_heard |= isinstance(action, (Stop, Coast)) or (isinstance(action, Run) and sent)

    def saw(self, look: Shown) -> None:
        """The drive showed *look*."""
        before, self._look = self._look, look
        self._is_fresh = True
        if before is not None and before.state.running and look.time - before.time <= self._patience:
            self.hours += (look.time - before.time) / 3600.0
        if not look.state.at_rest:
            self._rests_since = None
        elif self._rests_since is None:
            self._rests_since = look.time

    def missed(self) -> None:
        """The drive did not answer a look."""
        self.errors += 1

    def linked(self, now: float) -> bool:
        """Whether the drive was heard of lately."""
        return self._look is not None and now - self._look.time <= self._patience

    def shown(self, now: float) -> dict[str, bool | float]:
        """The pins that tell how the spindle is."""
        linked = self.linked(now)
        look = self._look or Shown(now)
        frequency = abs(look.frequency or 0.0)
        state = self._way(look)
        speed = math.copysign(frequency, -1.0 if state is State.REVERSE else 1.0) * self._scale.rpm_per_hz
        stopped = linked and look.stands
        return {
            "speed-feedback": speed,
            "speed-feedback-rps": speed / 60.0,
            "frequency-out": frequency,
            "at-speed": linked and self._is_at_speed(look),
            "stopped": stopped,
            "forward": linked and state is State.FORWARD,
            "reverse": linked and state is State.REVERSE,
            "brake": stopped and self.told is None,
            "fault": look.tripped or bool(self.trouble),
            "fault-code": look.fault,
            "current": look.current or 0.0,
            "ready": linked and look.ready is not False and not look.tripped and not self.trouble and self._may_start,
            "link-ok": linked,
            "link-quality": look.quality if linked else 0.0,
            "hours": self.hours,
            "error-count": self.errors,
            "initialized": self._look is not None,
        }

    @property
    def _may_start(self) -> bool:
        """Whether it runs, or would where `spindle-on` came: not while that stays on after a run that ended."""
        return self.told is not None or self._seen_off

    def _request(self, asked: Asked) -> Course | None:
        """How the pins want the motor to turn; None: not at all."""
        if not (asked.spindle_on or asked.spindle_fwd or asked.spindle_rev):
            return None
        if asked.spindle_fwd and asked.spindle_rev:
            return None
        speed = asked.speed_command
        if not math.isfinite(speed):
            return None
        word = round(min(abs(speed), self._scale.max_rpm) / self._scale.rpm_per_hz * self.counts)
        if word == 0:
            return None
        reverse = asked.spindle_rev or (speed < 0.0 and not asked.spindle_fwd)
        return Course(word, reverse)

    def _while_on(self, now: float, told: Course) -> Action | None:
        ended = self._ended(now)
        if ended or (self._look is not None and self._look.tripped):
            self.trouble = ended
            self._seen_off = False
            return Stop()
        if self._wanted is None:
            return Stop()
        if self._wanted.reverse is not told.reverse:
            return Run(self._wanted)
        if self._wanted.word not in (told.word, self._refused):
            return Speed(self._wanted.word)
        return None

    def _ended(self, now: float) -> str:
        """Why the run is over, though nobody asked for that and the drive shows no fault; empty where it is not."""
        if self._over:
            return self._over
        if not self.linked(now):
            return f"the drive has not answered for {self._patience:g} s: it was told to stop"
        tripped = self._look is not None and self._look.tripped
        if self._rests(now) >= ENDED_BY_ITSELF and not tripped:
            return "the drive stopped, and nobody here told it to"
        return ""

    def _while_off(self, now: float) -> Action | None:
        look = self._look if self.linked(now) else None
        if look is not None and self._is_fresh and self._not_heard:
            if look.state.running:
                return Stop()
            self._not_heard = self._rests(now) < ENDED_BY_ITSELF
        if look is not None and self._is_fresh and self._is_deaf(look):
            self.trouble = "the drive was told to stop and did not slow down: its voltage was taken off"
            self._falling = None
            return Coast()
        if self._reset_due:
            self._reset_due = False
            self.trouble = ""
            if look is not None and look.tripped:
                return Reset()
        if self._wanted is None or not self._seen_off:
            return None
        self._seen_off = False
        if look is None:
            self.trouble = "the spindle was switched on, and the drive does not answer: it was not started"
            return None
        if look.tripped:
            self.trouble = "the spindle was switched on, and the drive is in fault: it was not started"
            return None
        return Run(self._wanted)

    def _rests(self, now: float) -> float:
        """For how many seconds the drive has shown itself at rest."""
        return 0.0 if self._rests_since is None else now - self._rests_since

    def _is_deaf(self, look: Shown) -> bool:
        """Whether the motor turns on as if nobody had told it to stop."""
        if self._falling is None:
            return False
        if not look.state.running or look.frequency is None:
            self._falling = None
            return False
        lowest, since = self._falling
        if look.frequency < lowest:
            self._falling = (look.frequency, look.time)
            return False
        return look.time - since > PATIENCE

    def _way(self, look: Shown) -> State:
        """The state; of a drive that tells no direction, the one that it was told last."""
        if look.state is not State.RUNNING or self.told is None:
            return look.state
        return State.REVERSE if self.told.reverse else State.FORWARD

    def _is_at_speed(self, look: Shown) -> bool:
        if self.told is None or self.told != self._wanted or look.frequency is None:
            return False
        if self._way(look) is not (State.REVERSE if self.told.reverse else State.FORWARD):
            return False
        wanted = self.told.word / self.counts
        return abs(abs(look.frequency) - wanted) <= max(self._scale.tolerance * wanted, STANDSTILL)
