"""The figures of a response, against curves whose figures are known by formula."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivebus.trial import peak, ramp_figures, sine_figures, step_figures

FINE = 1 / 1000


def sampled(curve: Callable[[float], float], end: float, step: float = FINE) -> tuple[list[float], list[float]]:
    times = [place * step for place in range(-round(0.5 / step), round(end / step) + 1)]
    return times, [curve(time) for time in times]


@pytest.mark.parametrize(("start", "to"), [(10.0, 30.0), (40.0, 5.0), (0.0, 1.0)])
@pytest.mark.parametrize("constant", [0.2, 1.0])
def test_first_order(start: float, to: float, constant: float) -> None:
    def curve(time: float) -> float:
        return start + (to - start) * (1 - math.exp(-max(time, 0.0) / constant))

    times, values = sampled(curve, 12 * constant)
    figures = step_figures(times, values, start, to)
    assert figures is not None
    assert figures.rise_time == pytest.approx(constant * math.log(9), rel=1e-3)
    assert figures.settling_time == pytest.approx(constant * math.log(50), rel=1e-3)
    assert figures.overshoot == 0.0
    assert figures.steady_state_error == pytest.approx(0.0, abs=1e-3 * abs(to - start))


@pytest.mark.parametrize("damping", [0.1, 0.3, 0.5, 0.7])
@pytest.mark.parametrize("sign", [1, -1])
def test_second_order(damping: float, sign: int) -> None:
    rate, rest = 5.0, math.sqrt(1 - damping**2)

    def curve(time: float) -> float:
        if time < 0:
            return 20.0
        turn = rate * rest * time
        share = 1 - math.exp(-damping * rate * time) * (math.cos(turn) + damping / rest * math.sin(turn))
        return 20.0 + sign * 10.0 * share

    times, values = sampled(curve, 20.0)
    figures = step_figures(times, values, 20.0, 20.0 + sign * 10.0)
    assert figures is not None
    assert figures.overshoot == pytest.approx(100 * math.exp(-math.pi * damping / rest), rel=1e-3)
    # The envelope is never left, so it has settled when that has.
    assert figures.settling_time is not None
    assert figures.settling_time <= -math.log(0.02 * rest) / (damping * rate)
    after = [
        abs(value - 20.0 - sign * 10.0)
        for time, value in zip(times, values, strict=True)
        if time >= figures.settling_time + FINE
    ]
    assert max(after) <= 0.2 + 1e-9


@pytest.mark.parametrize(("start", "to", "rate"), [(10.0, 30.0, 5.0), (30.0, 10.0, -4.0), (0.0, 50.0, 200.0)])
@pytest.mark.parametrize("step", [FINE, 0.0371])
def test_ramp(start: float, to: float, rate: float, step: float) -> None:
    def curve(time: float) -> float:
        way = rate * max(time, 0.0)
        return start + (min(way, to - start) if rate > 0 else max(way, to - start))

    times, values = sampled(curve, 10.0, step)
    measured, stepped = ramp_figures(times, values, start, to), step_figures(times, values, start, to)
    assert measured is not None
    assert stepped is not None
    # Where the way is shorter than some samples, they do not tell.
    near = 1e-9 if abs(rate) * step < 0.1 * abs(to - start) else 0.5
    assert measured.rate == pytest.approx(rate, rel=near)
    assert stepped.rise_time == pytest.approx(0.8 * (to - start) / rate, rel=near)
    assert stepped.overshoot == 0.0


@pytest.mark.parametrize("constant", [0.0, 0.1, 1.0, 5.0])
@pytest.mark.parametrize("step", [FINE, 0.0391])
def test_sine_through_a_first_order(constant: float, step: float) -> None:
    period = 4.0
    speed = 2 * math.pi / period
    lag = math.atan(speed * constant)
    gain = math.cos(lag)
    times, given_ = sampled(lambda time: 15 + 5 * math.sin(speed * time), 16.0, step)
    values = [14.5 + 5 * gain * math.sin(speed * time - lag) for time in times]
    figures = sine_figures(times, given_, values, period)
    assert figures is not None
    assert figures.gain == pytest.approx(gain, rel=1e-6)
    assert figures.phase_lag == pytest.approx(math.degrees(lag), abs=1e-4)
    assert figures.lag == pytest.approx(lag / speed, abs=1e-6)
    assert figures.offset == pytest.approx(-0.5, abs=1e-6)


def test_what_the_samples_do_not_reach_is_not_told() -> None:
    times = [-0.1, 0.0, 0.1, 0.2]
    figures = step_figures(times, [10, 10, 12, 14], 10, 30)
    assert figures is not None
    assert (figures.rise_time, figures.settling_time) == (None, None)
    assert ramp_figures(times, [10, 10, 12, 14], 10, 30) is not None
    assert step_figures([-1.0, -0.5], [10, 10], 10, 30) is None
    assert sine_figures(times, [1, 2, 1, 2], [1, 2, 1, 2], 1.0) is None
    assert sine_figures([place / 10 for place in range(50)], [3.0] * 50, [3.0] * 50, 1.0) is None
    assert peak([-1.0, 0.0, 1.0, 2.0], [9.0, 1.0, 4.0, 4.0]) == (4.0, 1.0)
    assert peak([-1.0], [9.0]) is None


# Whole numbers and powers of two: then floats are exact, and so is the comparison.
CURVES = st.lists(st.integers(-400, 400), min_size=3, max_size=40)


@given(CURVES, st.integers(-100, 100), st.integers(-100, 100).filter(bool), st.integers(-4, 4), st.integers(-64, 64))
def test_scale_and_shift_change_no_share_and_no_time(
    values: list[int], start: int, step: int, power: int, shift: int
) -> None:
    times = [(place - 1) / 8 for place in range(len(values))]
    scale = 2.0**power
    for figures in (step_figures, ramp_figures):
        plain = figures(times, values, start, start + step)
        moved = figures(
            times, [scale * value + shift for value in values], scale * start + shift, scale * (start + step) + shift
        )
        assert plain is not None
        assert moved is not None
        for name, figure in vars(plain).items():
            in_units = name in ("rate", "steady_state_error")
            assert getattr(moved, name) == (figure * scale if in_units and figure is not None else figure)


@given(CURVES, st.integers(-100, 100), st.integers(-100, 100).filter(bool), st.integers(-4, 4))
def test_slower_is_slower_by_as_much(values: list[int], start: int, step: int, power: int) -> None:
    slower = 2.0**power
    times = [(place - 1) / 8 for place in range(len(values))]
    plain = step_figures(times, values, start, start + step)
    stretched = step_figures([time * slower for time in times], values, start, start + step)
    assert plain is not None
    assert stretched is not None
    for name in ("rise_time", "settling_time"):
        before = getattr(plain, name)
        assert getattr(stretched, name) == (None if before is None else before * slower)
    assert stretched.overshoot == plain.overshoot


@given(st.floats(0.1, 10), st.floats(-3.0, 3.0), st.floats(0.01, 100), st.floats(-100, 100), st.floats(0.5, 20))
def test_a_sine_is_the_same_in_any_unit(gain: float, lag: float, scale: float, shift: float, period: float) -> None:
    times = [place * period / 37 for place in range(150)]
    turns = [2 * math.pi * time / period for time in times]
    asked = [math.sin(turn) for turn in turns]
    came = [gain * math.sin(turn - lag) for turn in turns]
    figures = sine_figures(times, [scale * value + shift for value in asked], [scale * value for value in came], period)
    assert figures is not None
    assert figures.gain == pytest.approx(gain, rel=1e-6)
    assert math.radians(figures.phase_lag) == pytest.approx(lag, abs=1e-5)
    assert figures.offset == pytest.approx(-shift, abs=1e-6 * max(1.0, abs(shift)))
