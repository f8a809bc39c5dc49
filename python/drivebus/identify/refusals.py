"""Answers of a unit that is asked what it is. What they tell is decided in the core (`crates/drive`)."""

from __future__ import annotations

from typing import NamedTuple

from drivebus import tables
from drivebus.errors import BadAnswer, Refused

__all__ = ["LOCKED", "Answer", "busy"]

LOCKED = 0x09
"""The exception of an INVT drive that refuses all but the password. Whose unit this is, nobody knows yet."""


class Answer(NamedTuple):
    """How a unit answered the question for the word at *address*, its place: with a *word*, or with an *exception*."""

    address: int
    word: int | None
    exception: int | None


def busy(unit: int, place: int, exception: int, times: int, error: Refused) -> BadAnswer:
    """That *unit* refused *place* so many *times*, at last with *error*, and decided nothing by that."""
    return BadAnswer(
        f"unit {unit} is busy, or gets requests damaged: it refused {tables.shown(place)} with exception "
        f"{exception:02X}H {times} times",
        unit=unit,
        request=error.request,
        raw=error.raw,
        started=error.started,
        ended=error.ended,
    )
