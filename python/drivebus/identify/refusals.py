"""Answers of a unit that is asked what it is, and what the refusals among them tell."""

from __future__ import annotations

from typing import NamedTuple

from drivebus import tables
from drivebus.errors import BadAnswer, Refused
from drivebus.line.asking import Ask, Read

__all__ = [
    "LOCKED",
    "UNREACHED",
    "Answer",
    "answer_at",
    "answer_once",
    "busy",
]

_NO_FUNCTION = 0x01
"""In the Modbus specification: the unit does not know the function, and so has no such table."""

LOCKED = 0x09
"""The exception of an INVT drive that refuses all but the password. Whose unit this is, nobody knows yet."""

UNREACHED = (0x0A, 0x0B)
"""Exceptions by which a gateway says that the unit behind it is silent or out of reach. Modbus V1.1b3, section 7."""

_ASK_AGAIN = "ask_again"
"""What an exception means by which a unit says that it is busy, or got a damaged request."""

_AGAIN = 4
"""How often a word is asked for once more where the refusal of it decides nothing. A unit says so at once."""


class Answer(NamedTuple):
    """How a unit answered the question for the word at *address*, its place: with a *word*, or with an *exception*."""

    address: int
    word: int | None
    exception: int | None


async def answer_once(ask: Ask, unit: int, place: int) -> Answer:
    """How *unit* answers one question for the word at *place*, whatever a refusal of it means."""
    try:
        [word] = await ask(Read.at(unit, place))
    except Refused as error:
        return Answer(place, None, error.code)
    return Answer(place, word, None)


async def answer_at(ask: Ask, unit: int, place: int) -> Answer:
    """How *unit*, of which nothing is known, answers the question for the word at *place*.

    A refusal by which it decides nothing is no answer: it is asked again. So is one by 01H for holding registers: each
    family reads them, and one says by that code that the request came damaged.

    Raises:
        NoAnswer, BadAnswer, PortError: From *ask*; `BadAnswer` also where it says each time that it is busy, or gets
            requests damaged.
    """
    read = Read.at(unit, place)
    again = 0
    while True:
        try:
            [word] = await ask(read)
        except Refused as error:
            decides = error.code in UNREACHED or error.means != _ASK_AGAIN
            odd = error.code == _NO_FUNCTION and read.table == "holding"
            if again < _AGAIN and (odd or not decides):
                again += 1
                continue
            if not decides:
                raise busy(unit, place, error.code, again + 1, error) from error
            return Answer(place, None, error.code)
        return Answer(place, word, None)


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
