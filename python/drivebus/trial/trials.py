"""The trials that one calls: a step, a ramp and a sine, and what each gives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from drivebus import checks
from drivebus.advice import Text, argument
from drivebus.drive import Drive, check_drive
from drivebus.errors import BadArgument, NotAllowed
from drivebus.trial.abort_rules import Bounds, Roles
from drivebus.trial.metrics import RampFigures, SineFigures, StepFigures, peak, ramp_figures, sine_figures, step_figures
from drivebus.trial.recording import Recording
from drivebus.trial.samples import Samples
from drivebus.trial.setpoint_courses import Change, Wave

__all__ = ["Trial", "ramp", "sine", "step"]

_CURRENT = "output_current"

Kind: TypeAlias = Literal["step", "ramp", "sine"]
"""Which trial it was."""

_Told = Callable[[float, Mapping[str, float]], object]


@dataclass(frozen=True)
class Trial:
    """What came of a trial. The motor was told to stop, and the stop is proved, when there is one.

    Attributes:
        kind: `"step"`, `"ramp"` or `"sine"`.
        course: Where the setpoint went: `start` and `to`, or `low`, `high` and `period`, in Hz and seconds.
        samples: All that was recorded, from the start of the motor on: `times` in seconds, and one list of `values` for
            each name, with its `units`. The moment 0 is the first change of the setpoint; where it came to none, the
            first sample.
        roles: What the family calls `frequency`, `setpoint` and `current`: names of the samples, or None.
        figures: What it says in numbers; None where it was aborted, or has too few samples.
        peak_current: The highest current in A from the moment 0 on, and when that was in seconds; None if not known.
        ramp_setting: Hz/s that the drive is set to for this direction; None if it does not tell.
        aborted: Why the motor was stopped early; None where it was not.
    """

    kind: Kind
    course: Change | Wave
    samples: Samples
    roles: Roles
    figures: StepFigures | RampFigures | SineFigures | None
    peak_current: tuple[float, float] | None
    ramp_setting: float | None
    aborted: str | None

    def __str__(self) -> str:
        came = f"aborted: {self.aborted}" if self.aborted else str(self.figures or "too few samples")
        return f"{self.kind} from {self.course.low:g} to {self.course.high:g} Hz: {came}"


def step(
    drive: Drive,
    start: float,
    to: float,
    *,
    duration: float,
    max_current: float | None,
    margin: float | None = None,
    also: Iterable[str] = (),
    settle: float = 60.0,
    reverse: bool = False,
    force: bool = False,
    told: _Told | None = None,
) -> Trial:
    """Runs the motor at *start*, sets *to* at once, and records how it gets there. Then stops it, whatever happens.

    The drive goes along its own ramp; its figures are those of drive and motor together (`StepFigures`).

    Args:
        drive: The drive. It has to obey the bus.
        start: The setpoint in Hz at which the motor settles first.
        to: The setpoint in Hz that follows.
        duration: Seconds of the line's clock from then on, 0.1 to 3600.
        max_current: The highest output current in A; above it the motor is stopped. None only where no such bound is
            meant, or the family tells no current.
        margin: Hz by which the output frequency may leave *start* to *to*; beyond them the motor is stopped. None: a
            quarter of the step, at least 1 Hz.
        also: Names of registers that are recorded too. Each may make the samples fewer.
        settle: Seconds that the motor is given to settle at *start*.
        reverse: Turn the other way.
        force: Start although the link is bad.
        told: Is called with each sample as it comes: Unix time in seconds, and the values by name.

    The motor is also stopped where the drive trips, where somebody else stops it or changes its setpoint, where the
    line fails, and where the program is interrupted or ends: see `Drive.running`.

    Raises:
        NotAllowed: Something of this is out of range, not known of the family, or not verified for it; or the drive
            does not obey the bus, or is in fault. Nothing was sent that moves it.
        Refused, NoAnswer, BadAnswer, PortError: From the start, after which the motor is as it was; or from the trial,
            after which it was told to stop; a note of the error says where that failed.
        Unconfirmed: The start or the stop is not proved; the motor may turn.
    """
    course = Change(start, to)
    return _run(drive, "step", course, duration, max_current, margin, also, settle, reverse, force, told)


def ramp(
    drive: Drive,
    start: float,
    to: float,
    *,
    duration: float,
    max_current: float | None,
    margin: float | None = None,
    also: Iterable[str] = (),
    settle: float = 60.0,
    reverse: bool = False,
    force: bool = False,
    told: _Told | None = None,
) -> Trial:
    """As `step`, to measure how many Hz/s the motor makes: `RampFigures`, beside the drive's own `ramp_setting`."""
    course = Change(start, to)
    return _run(drive, "ramp", course, duration, max_current, margin, also, settle, reverse, force, told)


def sine(
    drive: Drive,
    low: float,
    high: float,
    *,
    period: float,
    duration: float,
    max_current: float | None,
    margin: float | None = None,
    also: Iterable[str] = (),
    settle: float = 60.0,
    reverse: bool = False,
    force: bool = False,
    told: _Told | None = None,
) -> Trial:
    """Moves the setpoint up and down between *low* and *high*, and measures how the motor follows: `SineFigures`.

    The setpoint is written after each sample, so it goes in small steps; the figures compare the output frequency with
    the setpoint that the drive has in force. A sine that is steeper than the drive's ramp is not followed.

    Args:
        drive: As of `step`, and so are all that are not named here.
        low: The lowest setpoint in Hz.
        high: The highest, in Hz.
        period: Seconds for once up and down, 0.1 to 3600.
        duration: Seconds; three periods or more, since the first counts for nothing.
        max_current: See `step`.
        margin: See `step`.
        also: See `step`.
        settle: See `step`; the motor settles in the middle.
        reverse: See `step`.
        force: See `step`.
        told: See `step`.

    Raises:
        NotAllowed, Refused, NoAnswer, BadAnswer, PortError, Unconfirmed: As for `step`.
    """
    course = Wave(low, high, period)
    if checks.number("duration", duration, 0.1, 3600.0) < 3 * period:
        raise BadArgument(
            f"{duration:g} s are less than three periods of {period:g} s, and the first counts for nothing; nothing "
            f"was sent. Give {3 * period:g} s or more"
        )
    return _run(drive, "sine", course, duration, max_current, margin, also, settle, reverse, force, told)


def _run(
    drive: Drive,
    kind: Kind,
    course: Change | Wave,
    duration: float,
    max_current: float | None,
    margin: float | None,
    also: Iterable[str],
    settle: float,
    reverse: bool,
    force: bool,
    told: _Told | None,
) -> Trial:
    check_drive(drive, f"trial.{kind}")
    duration = checks.number("duration", duration, 0.1, 3600.0)
    settle = checks.number("settle", settle, 0.0, 3600.0)
    if max_current is not None:
        max_current = checks.number("max_current", max_current, 0.0, above=True)
    margin = Bounds.usual_margin(course) if margin is None else checks.number("margin", margin, 0.0)
    roles = _roles(drive, max_current)
    names = [name for name in (roles.frequency, roles.setpoint, roles.current) if name]
    wanted = list(dict.fromkeys(also))
    names += [name for name in drive.readable(*wanted) if name not in names] if wanted else []
    setting = _ramp_setting(drive, course)
    recording = Recording(drive, course, Bounds(course, roles, max_current, margin), names, told)
    recording.run(duration, settle, reverse, force)
    samples = recording.samples
    return Trial(
        kind,
        course,
        samples,
        roles,
        None if recording.aborted else _figures(kind, course, samples, roles),
        peak(samples.times, samples[roles.current]) if roles.current else None,
        setting,
        recording.aborted,
    )


def _figures(
    kind: Kind, course: Change | Wave, samples: Samples, roles: Roles
) -> StepFigures | RampFigures | SineFigures | None:
    frequency = samples[roles.frequency]
    if isinstance(course, Wave):
        # Where the drive does not tell the setpoint in force, it is what it was given.
        given = samples[roles.setpoint] if roles.setpoint else [course.at(time) for time in samples.times]
        return sine_figures(samples.times, given, frequency, course.period)
    figures = ramp_figures if kind == "ramp" else step_figures
    return figures(samples.times, frequency, course.start, course.to)


def _roles(drive: Drive, max_current: float | None) -> Roles:
    """What the family calls what a trial looks at."""
    profile = drive.profile
    frequency = profile.role("frequency")
    if frequency is None:
        raise BadArgument(
            f"a trial needs the output frequency, and {profile.title} has no register of it that is known; nothing was "
            f"sent to unit {drive.unit}",
            unit=drive.unit,
        )
    drive.readable(frequency)
    setpoint = profile.role("setpoint")
    current = _CURRENT if _CURRENT in profile.names() and _may_be_read(drive, _CURRENT) else None
    if current is None and max_current is not None:
        raise BadArgument(
            Text(
                f"no register of the output current of {profile.title} may be read, so {max_current:g} A cannot be "
                f"watched; nothing was sent to unit {drive.unit}. ",
                argument("max_current", written="None"),
                " goes without",
            ),
            unit=drive.unit,
        )
    in_hz = setpoint is not None and profile.describe(setpoint).unit == "Hz" and _may_be_read(drive, setpoint)
    return Roles(frequency, setpoint if in_hz else None, current)


def _may_be_read(drive: Drive, name: str) -> bool:
    try:
        drive.readable(name)
    except NotAllowed:
        return False
    return True


def _ramp_setting(drive: Drive, course: Change | Wave) -> float | None:
    """How fast the drive is set to go where the course leads, in Hz/s."""
    profile = drive.profile
    falls = isinstance(course, Change) and course.to < course.start
    name = profile.role("deceleration") if falls else "acceleration_time_1"
    full = profile.role("ramp_start")
    known = {other for each in profile.names() for other in (each, profile.describe(each).name)}
    if (
        name is None
        or full is None
        or name not in known
        or not (_may_be_read(drive, name) and _may_be_read(drive, full))
    ):
        return None
    told = drive.read(name, full)
    seconds, hz = float(told[name]), float(told[full])
    if seconds <= 0:
        return None
    return -hz / seconds if falls else hz / seconds
