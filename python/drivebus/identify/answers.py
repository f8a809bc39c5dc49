"""Answers of a unit that is asked what it is, and what the refusals among them tell."""

from __future__ import annotations

from typing import NamedTuple

from drivebus.profile import Profile

__all__ = ["LOCKED", "NO_FUNCTION", "UNREACHED", "Answer", "no_such_address", "passes", "tells_nothing"]

_ILLEGAL_ADDRESS = 0x02
"""In the Modbus specification, and under this name in the profiles that list their exceptions."""

NO_FUNCTION = 0x01
"""In the Modbus specification: the unit does not know the function, and so has no such table."""

LOCKED = 0x09
"""The exception of an INVT drive that refuses all but the password. Whose unit this is, nobody knows yet."""

UNREACHED = (0x0A, 0x0B)
"""Exceptions by which a gateway says that the unit behind it is silent or out of reach. Modbus V1.1b3, section 7."""

_PASSING = (0x06, LOCKED, *UNREACHED)
"""Exceptions that say nothing of a unit, for they pass: it is busy or got a damaged request, a password locks it, or a
gateway does not reach it."""

_DAMAGED = "frame_error"
"""What profiles call an exception by which a unit says that the request came damaged, whatever its code."""


class Answer(NamedTuple):
    """How a unit answered the question for the word at *address*, its place: with a *word*, or with an *exception*."""

    address: int
    word: int | None
    exception: int | None


def no_such_address(profile: Profile, exception: int) -> bool:
    """Whether a unit of *profile* says by *exception* that it has no such address."""
    name, _ = profile.exception(exception)
    return exception == _ILLEGAL_ADDRESS or name == "illegal_address"


def passes(answer: Answer) -> bool:
    """Whether *answer* is a refusal that passes, whatever the unit is."""
    return answer.exception in _PASSING


def tells_nothing(profile: Profile, answer: Answer) -> bool:
    """Whether *answer* is a refusal that passes, and so tells nothing of a unit of *profile*."""
    code = answer.exception
    return code is not None and (passes(answer) or profile.exception(code)[0] == _DAMAGED)
