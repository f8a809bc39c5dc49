"""The order of writes: a drive that holds limits against each other accepts every step."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from drivebus.backup.order import Order, Step

from .limited import Pairs, State, accepts, in_any_order, in_any_way

CODES = ["P00.01", "P00.02", "P00.03", "P00.04", "P00.05"]


def carried_out(
    now: State, wanted: State, pairs: Pairs, last: tuple[str, ...] = (), *, passing: bool = False
) -> tuple[State, list[Step]]:
    """What such a drive has in the end, and the steps; it fails where the drive would refuse one."""
    state, steps = dict(now), []
    order = Order(now, wanted, pairs, last, lambda _code, _value: passing)
    while (step := order.next()) is not None:
        assert accepts(state, pairs, step.code, step.value), (step, state)
        state[step.code] = step.value
        order.wrote(step, step.value)
        steps.append(step)
        assert len(steps) < 50
    return state, steps


@st.composite
def limits(draw: st.DrawFn) -> tuple[Pairs, State, State]:
    """Limits without a circle, and two states within them."""
    every = list(itertools.combinations(CODES, 2))
    pairs = draw(st.lists(st.sampled_from(every), unique=True, max_size=6))
    names = draw(st.permutations(CODES))
    renamed = dict(zip(CODES, names, strict=True))
    states = []
    for _ in range(2):
        values = draw(st.lists(st.integers(0, 6), min_size=5, max_size=5))
        state = {code: float(value) for code, value in zip(CODES, values, strict=True)}
        for low, high in sorted(pairs):
            state[high] = max(state[low], state[high])
        states.append({renamed[code]: value for code, value in state.items()})
    return [(renamed[low], renamed[high]) for low, high in pairs], states[0], states[1]


@given(limits())
def test_between_two_sound_states_every_step_is_accepted_and_none_is_taken_twice(
    case: tuple[Pairs, State, State],
) -> None:
    pairs, now, wanted = case
    changing = {code: value for code, value in wanted.items() if value != now[code]}
    state, steps = carried_out(now, changing, pairs)
    assert state == wanted
    assert sorted(step.code for step in steps) == sorted(changing)
    assert all(step.final for step in steps)


@st.composite
def anything(draw: st.DrawFn) -> tuple[Pairs, State, State]:
    """Limits without a circle, what a drive has, within them or not, and what some of it shall be, within them."""
    codes = CODES[:4]
    pairs = draw(st.lists(st.sampled_from(list(itertools.combinations(codes, 2))), unique=True, max_size=5))
    values = st.lists(st.integers(0, 4).map(float), min_size=4, max_size=4)
    now, wanted = (dict(zip(codes, draw(values), strict=True)) for _ in range(2))
    fixed = draw(st.sets(st.sampled_from(codes), max_size=2))
    wanted.update({code: now[code] for code in fixed})
    assume(all(wanted[low] <= wanted[high] for low, high in pairs))
    names = dict(zip(codes, draw(st.permutations(codes)), strict=True))
    return (
        [(names[low], names[high]) for low, high in pairs],
        {names[code]: value for code, value in now.items()},
        {names[code]: value for code, value in wanted.items() if value != now[code]},
    )


@given(anything())
def test_from_anywhere_single_writes_lead_there_wherever_they_can(case: tuple[Pairs, State, State]) -> None:
    pairs, now, changing = case
    state, steps = carried_out(now, changing, pairs)
    assert all(step.final for step in steps)
    assert len({step.code for step in steps}) == len(steps)
    assert (state == {**now, **changing}) == in_any_order(now, changing, pairs)


@given(anything())
def test_from_anywhere_one_value_on_the_way_for_each_leads_there_wherever_anything_does(
    case: tuple[Pairs, State, State],
) -> None:
    pairs, now, changing = case
    state, steps = carried_out(now, changing, pairs, passing=True)
    assert (state == {**now, **changing}) == in_any_way(now, changing, pairs)
    assert all(len([step for step in steps if step.code == code]) <= 2 for code in changing)
    if in_any_order(now, changing, pairs):
        assert len(steps) == len(changing)


@given(anything())
def test_what_values_on_the_way_would_bring_is_told(case: tuple[Pairs, State, State]) -> None:
    pairs, now, changing = case
    order = Order(now, changing, pairs)
    while (step := order.next()) is not None:
        order.wrote(step, step.value)
    whole, _ = carried_out(now, changing, pairs, passing=True)
    told = order.passing(lambda _code, _value: True)
    assert {*told} == {code for code in order.rest if whole[code] == changing[code]}
    assert all({*by} <= {*order.rest} for by in told.values())


def test_one_pair_from_anywhere_to_anywhere() -> None:
    pairs = [("low", "high")]
    for low, high, to_low, to_high in itertools.product(map(float, range(5)), repeat=4):
        now, wanted = {"low": low, "high": high}, {"low": to_low, "high": to_high}
        changing = {code: value for code, value in wanted.items() if value != now[code]}
        state, steps = carried_out(now, changing, pairs, passing=True)
        assert (state == wanted) == in_any_way(now, changing, pairs), (now, wanted, steps)


@pytest.mark.parametrize(
    ("now", "wanted", "steps"),
    [
        # Up: the limit first. Down: what it limits first.
        ((50, 50), (90, 80), ["high", "low"]),
        ((90, 80), (50, 50), ["low", "high"]),
        # Beyond the limit, and neither can go where it shall: one goes half the way.
        ((20, 60), (50, 30), ["high", "low", "high"]),
    ],
)
def test_limits_come_before_values(now: tuple[int, int], wanted: tuple[int, int], steps: list[str]) -> None:
    """Each pair is high, low."""
    states = [{"high": float(high), "low": float(low)} for high, low in (now, wanted)]
    state, taken = carried_out(states[0], states[1], [("low", "high")], passing=True)
    assert (state, [step.code for step in taken]) == (states[1], steps)


def test_sources_come_last_in_their_order() -> None:
    now = dict.fromkeys(CODES, 0.0)
    wanted = dict.fromkeys(CODES, 1.0)
    _, steps = carried_out(now, wanted, [("P00.01", "P00.05")], ("P00.03", "P00.01"))
    assert [step.code for step in steps] == ["P00.05", "P00.02", "P00.04", "P00.03", "P00.01"]


def test_no_step_is_taken_for_nothing() -> None:
    """The limit is not among what is written: half the way to it would be neither the old nor the new value."""
    order = Order({"low": 10.0, "high": 20.0}, {"low": 30.0}, [("low", "high")], (), lambda _code, _value: True)
    assert order.next() is None
    assert (order.rest, order.hindrance("low", 30.0)) == (["low"], "high")
    assert order.passing(lambda _code, _value: True) == {}
