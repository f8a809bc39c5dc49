"""Arguments are checked here, at the door, so that nothing wrong reaches a line.

Every message names the value that came, what is allowed, and for a misspelt name the closest match.
"""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Iterable, Sequence
from typing import SupportsIndex

from drivebus import tables
from drivebus.advice import Advice, Text
from drivebus.errors import BadArgument, NotAllowed

__all__ = [
    "UNITS",
    "address",
    "closest",
    "digits",
    "flag",
    "number",
    "of_table",
    "one_of",
    "path",
    "payload",
    "shown",
    "unit",
    "unread",
    "whole",
]

UNITS = range(1, 248)
"""The addresses that the specification gives to units. Which others a line has, `drivebus.line.addresses` knows."""

_MOST_DIGITS = 20
"""Digits of the largest number that anything here can be: 2 ** 64 - 1."""


def whole(what: str, value: object, low: int, high: int, *, hexadecimal: bool = False) -> int:
    """*value* as an int in *low*..*high*; anything that is not a whole number is refused."""
    # Nearly every call: what follows takes a hundred times as long.
    if type(value) is int and low <= value <= high:
        return value
    allowed = f"{low:#06x} to {high:#06x}" if hexadecimal else f"{low} to {high}"
    if isinstance(value, bool) or not isinstance(value, SupportsIndex):
        raise BadArgument(f"{what} {shown(value)} is not a whole number; allowed is {allowed}")
    number = operator.index(value)
    if not low <= number <= high:
        said = f"{number:#06x}" if hexadecimal and 0 <= number < 1 << 64 else shown(number)
        raise BadArgument(f"{what} {said} is out of range; allowed is {allowed}")
    return number


def unit(value: object) -> int:
    """A unit address, 1..247. Broadcast has a method of its own."""
    if type(value) is int and value in UNITS:
        return value
    if value == 0 and not isinstance(value, bool):
        raise BadArgument(
            Text(
                "unit 0 is the broadcast address, which nobody answers; allowed is 1 to 247",
                Advice("broadcast", None, ", or use broadcast()"),
            )
        )
    return whole("unit", value, UNITS[0], UNITS[-1])


def address(value: object) -> int:
    """A register address, 0..0xFFFF."""
    return whole("address", value, 0, 0xFFFF, hexadecimal=True)


def payload(value: object) -> int | list[int]:
    """What a write carries: one word, or 1..123 words, each 0..0xFFFF."""
    if isinstance(value, (str, bytes, bytearray)) or not isinstance(value, Iterable):
        return whole("value", value, 0, 0xFFFF)
    words = [whole(f"value {index} of the sequence:", word, 0, 0xFFFF) for index, word in enumerate(value)]
    whole("number of values", len(words), 1, 123)
    return words


def of_table(table: object, value: object) -> int | list[int]:
    """What a write to *table* carries: words, or of a coil 0 or 1."""
    if table == "holding":
        return payload(value)
    if one_of("table", table, tables.TABLES) not in tables.WRITABLE:
        raise BadArgument(f"table {shown(table)} can only be read; {' and '.join(tables.WRITABLE)} can be written")
    if isinstance(value, Iterable):
        raise BadArgument(f"value {shown(value)} is not allowed: one coil is written at a time, to 0 or 1")
    return int(value) if isinstance(value, bool) else whole("value of a coil", value, 0, 1)


def number(what: str, value: object, low: float, high: float = math.inf, *, above: bool = False) -> float:
    """*value* as a finite float in *low*..*high*; with *above*, *low* itself is refused."""
    allowed = f"{'more than ' if above else ''}{low:g}" + ("" if math.isinf(high) else f" to {high:g}")
    allowed += " or more" if math.isinf(high) and not above else ""
    if isinstance(value, (bool, str, bytes)):
        raise BadArgument(f"{what} {shown(value)} is not a number; allowed is {allowed}")
    try:
        result = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise BadArgument(f"{what} {shown(value)} is not a number; allowed is {allowed}") from None
    if not math.isfinite(result) or not low <= result <= high or (above and result == low):
        raise BadArgument(f"{what} {value} is out of range; allowed is {allowed}")
    return result


def flag(what: str, value: object) -> bool:
    """*value*, if it is True or False."""
    if isinstance(value, bool):
        return value
    raise BadArgument(f"{what} {shown(value)} is neither True nor False")


def one_of(what: str, value: object, allowed: Sequence[str]) -> str:
    """*value*, if it is one of *allowed*."""
    if isinstance(value, str) and value in allowed:
        return value
    hint = closest(value, allowed) if isinstance(value, str) else ""
    raise BadArgument(f"{what} {shown(value)} is unknown; allowed is {', '.join(allowed)}{hint}")


def path(what: str, value: object) -> str:
    """*value* as the text of a path, if the system can be handed it. Whether it leads anywhere is not looked at."""
    try:
        text = os.fspath(value)  # type: ignore[call-overload]
        if isinstance(text, str) and text.strip() and "\0" not in text:
            os.fsencode(text)
            return text
    except (TypeError, UnicodeError):
        pass
    raise BadArgument(f"{what} {shown(value)} is not a path")


def digits(text: str) -> int | None:
    """The number that *text* writes in digits, or None. Thousands of them are no number that anybody means."""
    return int(text) if text.isdecimal() and len(text) <= _MOST_DIGITS else None


def shown(value: object) -> str:
    """*value* as Python shows it, a text in double quotes; a number that it refuses to show, by its size."""
    try:
        text = repr(value)
    except ValueError:
        return f"of {value.bit_length()} bits" if isinstance(value, int) else f"of type {type(value).__name__}"
    if type(value) is str and text.startswith("'"):
        inner = text[1:-1].replace("\\'", "'").replace('"', '\\"')
        return f'"{inner}"'
    return text


def closest(name: str, known: Iterable[str]) -> str:
    """`"; did you mean …?"` for a misspelt *name*, or nothing where nothing is near."""
    from difflib import get_close_matches

    by_lower = {candidate.lower(): candidate for candidate in known}
    matches = get_close_matches(name.lower(), by_lower, n=1, cutoff=0.5)
    return f'; did you mean "{by_lower[matches[0]]}"?' if matches else ""


def unread(name: object, error: OSError) -> NotAllowed:
    """What says that the file *name* cannot be read, and why."""
    reason = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror or error
    return BadArgument(f"{name} cannot be read: {reason}")


def counted(count: int, what: str) -> str:
    """How many there are of *what*, in words: `1 request`, `2 requests`."""
    return f"{count} {what}{'' if count == 1 else 's'}"
