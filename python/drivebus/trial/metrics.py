"""The figures of a response, as pure functions of samples: moments in seconds, and one value for each of them.

Nothing here knows drives. A value between two samples lies on the straight line between them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

__all__ = [
    "RampFigures",
    "SineFigures",
    "StepFigures",
    "peak",
    "ramp_figures",
    "sine_figures",
    "step_figures",
]

RISE_FROM, RISE_TO = 0.1, 0.9
"""Shares of a step between which its rise is timed."""

SETTLED = 0.02
"""Share of a step: what stays that near its end has settled."""

_END = 0.1
"""Share of the time, at its end, over which the steady state is the mean."""


@dataclass(frozen=True)
class StepFigures:
    """How a value followed a step of its setpoint. What the samples do not reach is None.

    Attributes:
        rise_time: Seconds from 10 % to 90 % of the step.
        overshoot: How far it went beyond the end, in percent of the step; 0.0 where it did not.
        settling_time: Seconds from the step until it stays within 2 % of the step around its end.
        steady_state_error: The mean of the last tenth of the time less the end of the step, in the value's unit.
    """

    rise_time: float | None
    overshoot: float
    settling_time: float | None
    steady_state_error: float


@dataclass(frozen=True)
class RampFigures:
    """How fast a value went from one setpoint to the next.

    Attributes:
        rate: Units of the value in a second, from 10 % to 90 % of the way; negative downwards. None where it did not
            come so far.
        steady_state_error: As of `StepFigures`.
    """

    rate: float | None
    steady_state_error: float


@dataclass(frozen=True)
class SineFigures:
    """How a value followed a sine of its setpoint, once that had gone on for a while.

    Attributes:
        gain: The amplitude of the value as a share of that of the setpoint.
        phase_lag: Degrees by which it comes behind, above -180 up to 180.
        lag: The same in seconds.
        offset: The mean of the value less that of the setpoint, in the value's unit.
    """

    gain: float
    phase_lag: float
    lag: float
    offset: float


def step_figures(times: Sequence[float], values: Sequence[float], start: float, to: float) -> StepFigures | None:
    """The figures of a step at the moment 0 from *start* to *to*; None without two samples from then on.

    Args:
        times: Seconds, rising; those before the step are negative.
        values: What was measured then, in the unit of *start* and *to*.
        start: The setpoint before the step.
        to: The setpoint after it; another one.
    """
    moments, shares = _shares(times, values, start, to)
    if len(moments) < 2:
        return None
    begun, ended = _reached(moments, shares, RISE_FROM), _reached(moments, shares, RISE_TO)
    return StepFigures(
        rise_time=None if begun is None or ended is None else ended - begun,
        overshoot=100.0 * max(0.0, max(shares) - 1.0),
        settling_time=_settled(moments, shares),
        steady_state_error=_steady(moments, shares) * (to - start),
    )


def ramp_figures(times: Sequence[float], values: Sequence[float], start: float, to: float) -> RampFigures | None:
    """The figures of the way from *start* to *to*; arguments as of `step_figures`."""
    moments, shares = _shares(times, values, start, to)
    if len(moments) < 2:
        return None
    begun, ended = _reached(moments, shares, RISE_FROM), _reached(moments, shares, RISE_TO)
    rate = None
    if begun is not None and ended is not None and ended > begun:
        rate = (RISE_TO - RISE_FROM) / (ended - begun) * (to - start)
    return RampFigures(rate, _steady(moments, shares) * (to - start))


def sine_figures(
    times: Sequence[float], setpoints: Sequence[float], values: Sequence[float], period: float
) -> SineFigures | None:
    """Gain and lag of *values* behind *setpoints*, a sine of *period* seconds that begins at the moment 0.

    Both are fitted by least squares over all whole periods but the first, in which the value finds its way. None
    without two periods, or where the setpoint does not move.
    """
    whole = math.floor(max(times, default=0.0) / period + 1e-9)
    taken = [place for place, time in enumerate(times) if period <= time <= whole * period]
    if whole < 2 or len(taken) < 4:
        return None
    turns = [2 * math.pi * times[place] / period for place in taken]
    asked = _fitted(turns, [setpoints[place] for place in taken])
    given = _fitted(turns, [values[place] for place in taken])
    if asked is None or given is None or math.isclose(asked.amplitude, 0.0, abs_tol=1e-12):
        return None
    behind = math.degrees(asked.phase - given.phase)
    behind = 180.0 - (180.0 - behind) % 360.0
    return SineFigures(
        gain=given.amplitude / asked.amplitude,
        phase_lag=behind,
        lag=behind / 360.0 * period,
        offset=given.mean - asked.mean,
    )


def peak(times: Sequence[float], values: Sequence[float]) -> tuple[float, float] | None:
    """The greatest of *values* from the moment 0 on, and when it came first; None where there is none."""
    after = [(value, -time) for time, value in zip(times, values, strict=True) if time >= 0]
    if not after:
        return None
    value, time = max(after)
    return value, -time


def _shares(
    times: Sequence[float], values: Sequence[float], start: float, to: float
) -> tuple[list[float], list[float]]:
    """The samples from the step on, as shares of it; the first is where the line between two samples has it."""
    shares = [(value - start) / (to - start) for value in values]
    first = next((place for place, time in enumerate(times) if time >= 0), len(times))
    moments, after = list(times[first:]), shares[first:]
    if moments and first and moments[0] > 0:
        after.insert(0, _between(times[first - 1], shares[first - 1], times[first], shares[first], 0.0))
        moments.insert(0, 0.0)
    return moments, after


def _between(time: float, value: float, later: float, there: float, at: float) -> float:
    return value + (there - value) * (at - time) / (later - time)


def _reached(moments: Sequence[float], shares: Sequence[float], share: float) -> float | None:
    """When *share* was reached first."""
    if shares[0] >= share:
        return moments[0]
    for time, value, later, there in _pairs(moments, shares):
        if there >= share:
            return _between(value, time, there, later, share)
    return None


def _settled(moments: Sequence[float], shares: Sequence[float]) -> float | None:
    """Since when all shares are near 1; None where the last is not."""
    if abs(shares[-1] - 1.0) > SETTLED:
        return None
    since = moments[0]
    for time, value, later, there in _pairs(moments, shares):
        if abs(value - 1.0) > SETTLED:
            edge = 1.0 + math.copysign(SETTLED, value - 1.0)
            inside = abs(there - 1.0) <= SETTLED
            since = _between(value, time, there, later, edge) if inside else later
    return since


def _steady(moments: Sequence[float], shares: Sequence[float]) -> float:
    """How far the last shares are from 1, in the mean."""
    begin = moments[-1] - _END * (moments[-1] - moments[0])
    last = [share - 1.0 for time, share in zip(moments, shares, strict=True) if time >= begin]
    return math.fsum(last) / len(last)


def _pairs(moments: Sequence[float], shares: Sequence[float]) -> Iterator[tuple[float, float, float, float]]:
    return ((moments[at], shares[at], moments[at + 1], shares[at + 1]) for at in range(len(moments) - 1))


@dataclass(frozen=True)
class _Sine:
    """`mean + amplitude * sin(turn + phase)`."""

    mean: float
    amplitude: float
    phase: float


def _fitted(turns: Sequence[float], values: Sequence[float]) -> _Sine | None:
    """The sine that is nearest to *values*; None where the moments do not tell."""
    count = len(turns)
    middle = math.fsum(values) / count
    columns = [[1.0] * count, [math.sin(turn) for turn in turns], [math.cos(turn) for turn in turns]]
    matrix = [[math.fsum(map(float.__mul__, one, other)) for other in columns] for one in columns]
    right = [math.fsum(share * (value - middle) for share, value in zip(one, values, strict=True)) for one in columns]
    whole = _determinant(matrix)
    if math.isclose(whole, 0.0, abs_tol=1e-9 * count**3):
        return None
    found = []
    for place in range(3):
        changed = [[*row[:place], value, *row[place + 1 :]] for row, value in zip(matrix, right, strict=True)]
        found.append(_determinant(changed) / whole)
    mean, in_phase, across = found
    return _Sine(middle + mean, math.hypot(in_phase, across), math.atan2(across, in_phase))


def _determinant(rows: Sequence[Sequence[float]]) -> float:
    (a, b, c), (d, e, f), (g, h, i) = rows
    return math.fsum((a * e * i, b * f * g, c * d * h, -c * e * g, -b * d * i, -a * f * h))
