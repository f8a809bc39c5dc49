"""Values on the way, where a drive stands beyond its own limits and each parameter waits for another.

Where 60 stands in a parameter whose limit is 20, and 30 and 50 are wanted, the drive takes neither: 30 is above the
limit that it has, and 50 is below the value that it has. One of the two has to go to the other first. Pure arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

__all__ = ["Pairs", "Step", "detour", "hindrance", "reached"]

Pairs = Sequence[tuple[str, str]]
"""Parameters of which the first is never above the second."""


class Step(NamedTuple):
    """One write: *value* in engineering units, on the way only if not *final*."""

    code: str
    value: float
    final: bool


def hindrance(now: Mapping[str, float], pairs: Pairs, code: str, value: float) -> str | None:
    """The parameter that does not let *code* be *value*; None if nothing hinders."""
    for low, high in pairs:
        if (code == high and value < now[low]) or (code == low and value > now[high]):
            return low if code == high else high
    return None


def detour(
    now: Mapping[str, float], wanted: Mapping[str, float], pairs: Pairs, may: Callable[[str, float], bool]
) -> list[Step]:
    """The fewest steps after which most of *wanted* can be written; none where no step leads further.

    All go up as far as what they are above of, or all go down as far as what they are below of: the drive takes each of
    these steps, and then stands within its limits. What can be left out of that is left out.

    Args:
        now: What the drive has.
        wanted: What is still to be written, and cannot be.
        pairs: As above.
        may: Whether a parameter can have a value on the way.
    """
    best: list[Step] = []
    for nearest, leads in ((max, [(high, low) for low, high in pairs]), (min, pairs)):
        way = []
        for code, beyond in _from_the_end(wanted, leads):
            value = nearest([wanted[code], *(now[other] for other in beyond)])
            if value == wanted[code] or (value != now[code] and may(code, value)):
                way.append(Step(code, value, value == wanted[code]))
        for step in [step for step in way if not step.final]:
            without = [other for other in way if other != step]
            if reached(now, wanted, pairs, without) >= reached(now, wanted, pairs, way):
                way = without
        if _worth(now, wanted, pairs, way) > _worth(now, wanted, pairs, best):
            best = way
    return best


def _worth(now: Mapping[str, float], wanted: Mapping[str, float], pairs: Pairs, way: Sequence[Step]) -> tuple[int, int]:
    return len(reached(now, wanted, pairs, way)), -sum(not step.final for step in way)


def reached(
    now: Mapping[str, float], wanted: Mapping[str, float], pairs: Pairs, way: Iterable[Step] = ()
) -> frozenset[str]:
    """What of *wanted* the drive takes after *way*, as far as it takes that."""
    then, rest = dict(now), dict(wanted)
    for code, value, final in way:
        if hindrance(then, pairs, code, value) is None:
            then[code] = value
            if final:
                del rest[code]
    while takes := [code for code in rest if hindrance(then, pairs, code, rest[code]) is None]:
        then[takes[0]] = rest.pop(takes[0])
    return frozenset({*wanted} - {*rest})


def _from_the_end(codes: Iterable[str], leads: Pairs) -> list[tuple[str, set[str]]]:
    """Each of *codes* with all that *leads* lead to from it, through others of them; who leads farthest comes first."""
    inside = {*codes}
    found: list[tuple[str, set[str]]] = []
    for code in codes:
        beyond: set[str] = set()
        waiting = [code]
        while waiting:
            here = waiting.pop()
            new = {there for start, there in leads if start == here} - beyond
            beyond |= new
            waiting += new & inside
        found.append((code, beyond))
    return sorted(found, key=lambda item: -len(item[1]))
