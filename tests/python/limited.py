"""A drive that takes a value only within its limits, and what can be reached on it at all: an oracle that searches."""

from __future__ import annotations

import itertools
from collections import deque

State = dict[str, float]
Pairs = list[tuple[str, str]]
"""Parameters of which the first is never above the second."""


def accepts(state: State, pairs: Pairs, code: str, value: float) -> bool:
    """Whether the drive takes *value*, by what its other parameters say now."""
    then = {**state, code: value}
    return all(then[low] <= then[high] for low, high in pairs if code in (low, high))


def in_any_order(now: State, changing: State, pairs: Pairs) -> bool:
    """Whether some order in which each is written once, and accepted, leads there: all orders, tried."""
    for codes in itertools.permutations(changing):
        state = dict(now)
        for code in codes:
            if not accepts(state, pairs, code, changing[code]):
                break
            state[code] = changing[code]
        else:
            return True
    return False


def in_any_way(now: State, changing: State, pairs: Pairs) -> bool:
    """Whether any accepted writes of *changing* lead there, of values 0..4: all states, searched."""
    start = tuple(now.values())
    seen, waiting = {start}, deque([start])
    while waiting:
        state = dict(zip(now, waiting.popleft(), strict=True))
        for code, value in itertools.product(changing, map(float, range(5))):
            then = tuple({**state, code: value}.values())
            if then not in seen and accepts(state, pairs, code, value):
                seen.add(then)
                waiting.append(then)
    return tuple({**now, **changing}.values()) in seen
