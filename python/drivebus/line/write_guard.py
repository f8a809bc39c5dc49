"""What a raw write would command: words held against the command registers of the unit's family, and of the others.

What may be sent is decided in the core (`crates/drive`), here are its words.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from drivebus import _native, tables
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, NotAllowed
from drivebus.profile import Profile
from drivebus.profile.family import family_of

__all__ = ["check_words", "code_text", "commanded_at", "prepare_guard"]

_HINT = Text("nothing was sent; if it is meant, say ", argument("force", True))


def code_text(code: int) -> str:
    """A command's code for people: as manuals print it, small numbers in decimal and words of bits in hexadecimal."""
    return f"{code}" if code <= 0xFF else f"{code:04X}H"


def check_words(families: Iterable[Profile], unit: int, address: int, words: int | Sequence[int]) -> None:
    """Raises `NotAllowed` if the words at *address* are a command that none of *families*, which *unit* may be, has."""
    forbidden = _native.forbidden([family_of(family) for family in families], address, words)
    if forbidden is None:
        return
    if forbidden[0] == "undefined":
        _, title, place, word, codes = forbidden
        raise _undefined(unit, title, place, word, codes)
    _, title, place, own, others = forbidden
    raise _foreign(unit, title, place, own, others)


def _undefined(unit: int, title: str, place: int, word: int, known: Mapping[int, str]) -> NotAllowed:
    codes = ", ".join(f"{code_text(code)} {name.replace('_', ' ')}" for code, name in sorted(known.items()))
    return BadArgument(
        Text(
            f"{code_text(word)} at {tables.shown(place)} is not a command of unit {unit}, which is known as "
            f"{title}: its codes are {codes or 'not known'}; ",
            _HINT,
        ),
        unit=unit,
    )


def _foreign(unit: int, title: str, place: int, own: int | None, others: Iterable[str]) -> NotAllowed:
    where = "is not known" if own is None else f"is {tables.shown(own)}"
    return BadArgument(
        Text(
            f"{tables.shown(place)} is the command register of {', '.join(others)}; unit {unit} is known as "
            f"{title}, whose command register {where}; ",
            _HINT,
        ),
        unit=unit,
    )


def commanded_at(address: int) -> str | None:
    """The shipped families whose command register is at *address*, for people; None where there are none."""
    return ", ".join(_native.commanded_at(address)) or None


def prepare_guard(family: Profile) -> None:
    """Works out what `check_words` looks at of *family* and all others, so that nothing urgent waits for that."""
    family_of(family)
