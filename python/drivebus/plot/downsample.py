"""Leaves out points of a curve, and none of its peaks."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["thinned"]


def thinned(
    times: Sequence[float], values: Sequence[float | None], most: int
) -> tuple[list[float], list[float | None]]:
    """The curve with *most* points or some more: of each stretch of time its least and its greatest, and each gap.

    A gap is a value of None.
    """
    if len(times) <= most:
        return list(times), list(values)
    stretches = max(most // 2, 1)
    kept_times: list[float] = []
    kept: list[float | None] = []
    for number in range(stretches):
        begin, end = len(times) * number // stretches, len(times) * (number + 1) // stretches
        for place in _kept(values, begin, end):
            kept_times.append(times[place])
            kept.append(values[place])
    return kept_times, kept


def _kept(values: Sequence[float | None], begin: int, end: int) -> list[int]:
    """The places of the least and the greatest from *begin* to *end*, and of the gaps, in order."""
    places = range(begin, end)
    there = [place for place in places if values[place] is not None]
    gaps = [place for place in places if values[place] is None]
    if not there:
        return gaps[:1]

    def value(place: int) -> float:
        found = values[place]
        return 0.0 if found is None else found

    return sorted({min(there, key=value), max(there, key=value), *gaps})
