"""The order of writes: a drive that holds limits against each other accepts every step."""

from __future__ import annotations

import itertools
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivebus.backup.order import Order, Step

CODES = ["P00.01", "P00.02", "P00.03", "P00.04", "P00.05"]
State = dict[str, float]
Pairs = list[tuple[str, str]]


def accepts(state: State, pairs: Pairs, code: str, value: float) -> bool:
    """The oracle: a drive that takes a value only within what its other parameters then say."""
    then = {**state, code: value}
    return all(then[low] <= then[high] for low, high in pairs if code in (low, high))


def carried_out(now: State, wanted: State, pairs: Pairs, last: tuple[str, ...] = ()) -> tuple[State, list[Step]]:
    """What such a drive has in the end, and the steps; it fails where the drive would refuse one."""
    state, steps = dict(now), []
    order = Order(now, wanted, pairs, last)
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


def reachable(now: State, wanted: State, pairs: Pairs) -> bool:
    """Whether any order of accepted writes leads there: all states of a small drive, searched."""
    codes = list(now)
    seen = {tuple(now.values())}
    waiting = deque(seen)
    while waiting:
        state = dict(zip(codes, waiting.popleft(), strict=True))
        for code, value in itertools.product(codes, range(5)):
            if accepts(state, pairs, code, float(value)):
                then = tuple({**state, code: float(value)}.values())
                if then not in seen:
                    seen.add(then)
                    waiting.append(then)
    return tuple(wanted.values()) in seen


def test_one_pair_from_anywhere_to_anywhere() -> None:
    pairs = [("low", "high")]
    for low, high, to_low, to_high in itertools.product(range(5), repeat=4):
        now, wanted = {"low": float(low), "high": float(high)}, {"low": float(to_low), "high": float(to_high)}
        changing = {code: value for code, value in wanted.items() if value != now[code]}
        state, steps = carried_out(now, changing, pairs)
        # Where a drive was left beyond its own limits, it may have to stay as it is; what is sound is reached.
        if to_low <= to_high:
            assert (state == wanted) == reachable(now, wanted, pairs), (now, wanted, steps)
        elif changing:
            assert state != wanted


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
    state, taken = carried_out(states[0], states[1], [("low", "high")])
    assert (state, [step.code for step in taken]) == (states[1], steps)


def test_sources_come_last_in_their_order() -> None:
    now = dict.fromkeys(CODES, 0.0)
    wanted = dict.fromkeys(CODES, 1.0)
    _, steps = carried_out(now, wanted, [("P00.01", "P00.05")], ("P00.03", "P00.01"))
    assert [step.code for step in steps] == ["P00.05", "P00.02", "P00.04", "P00.03", "P00.01"]


def test_no_step_is_taken_for_nothing() -> None:
    """The limit is not among what is written: half the way to it would be neither the old nor the new value."""
    order = Order({"low": 10.0, "high": 20.0}, {"low": 30.0}, [("low", "high")])
    assert order.next() is None
    assert (order.rest, order.hindrance("low", 30.0)) == (["low"], "high")
