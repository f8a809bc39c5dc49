"""What a raw write would command: words held against the command registers of the unit's family, and of the others.

The same word means different things to different families: 5 stops an INVT drive and lets a VFD500 coast. So a write by
address is held against the command register of the unit's family, and against those of the other families as well.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence

from drivebus import tables
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, NotAllowed
from drivebus.profile import Profile, profiles

__all__ = ["check_words", "code_text", "commanded_at", "prepare_guard"]

_HINT = Text("nothing was sent; if it is meant, say ", argument("force", True))


def code_text(code: int) -> str:
    """A command's code for people: as manuals print it, small numbers in decimal and words of bits in hexadecimal."""
    return f"{code}" if code <= 0xFF else f"{code:04X}H"


def check_words(families: Iterable[Profile], unit: int, address: int, words: int | Sequence[int]) -> None:
    """Raises `NotAllowed` if the words at *address* are a command that none of *families*, which *unit* may be, has."""
    known = list(families)
    for offset, word in enumerate([words] if isinstance(words, int) else words):
        here = ((family, _codes_at(family, address + offset)) for family in known)
        commanded = [(family, codes) for family, codes in here if codes is not None]
        if commanded:
            if not any(word in codes for _, codes in commanded):
                raise _undefined(*commanded[0], unit, address + offset, word)
        else:
            _check_foreign(known, unit, address + offset)


def _undefined(family: Profile, known: Mapping[int, str], unit: int, address: int, word: int) -> NotAllowed:
    codes = ", ".join(f"{code_text(code)} {name.replace('_', ' ')}" for code, name in sorted(known.items()))
    return BadArgument(
        Text(
            f"{code_text(word)} at {tables.shown(address)} is not a command of unit {unit}, which is known as "
            f"{family.title}: its codes are {codes or 'not known'}; ",
            _HINT,
        ),
        unit=unit,
    )


def _check_foreign(families: Sequence[Profile], unit: int, address: int) -> None:
    """Nothing of its own stands there, but another family has its command register there."""
    foreign = _command_registers()
    plain = {address, *(_plain(family, address) for family in families)}
    others = next((foreign[place] for place in plain if place in foreign), None)
    if others is None or any(family.name_at(place) is not None for family in families for place in plain):
        return
    own = families[0].command_address
    where = "is not known" if own is None else f"is {tables.shown(own)}"
    raise BadArgument(
        Text(
            f"{tables.shown(address)} is the command register of {others}; unit {unit} is known as "
            f"{families[0].title}, whose command register {where}; ",
            _HINT,
        ),
        unit=unit,
    )


def _codes_at(family: Profile, address: int) -> Mapping[int, str] | None:
    """The commands of *family* at *address*, or without the bit that may tell RAM from EEPROM; None: none are there."""
    registers = family.command_registers()
    return registers.get(address, registers.get(_plain(family, address)))


def _plain(family: Profile, address: int) -> int:
    """*address* without what tells RAM from EEPROM."""
    if tables.split(address)[0] != "holding":
        return address
    memory = family.memory()
    return address & ~(1 << (15 if memory is None else memory.bit))


def commanded_at(address: int) -> str | None:
    """The shipped families whose command register is at *address*, for people; None where there are none."""
    return _command_registers().get(address)


def prepare_guard() -> None:
    """Works out what `check_words` looks at, so that nothing urgent waits for that."""
    _command_registers()


@functools.cache
def _command_registers() -> dict[int, str]:
    """The command registers of the shipped families, and whose they are."""
    found: dict[int, list[str]] = {}
    for name in profiles():
        profile = Profile.builtin(name)
        for address in profile.command_registers():
            found.setdefault(address, []).append(profile.title)
    return {address: ", ".join(titles) for address, titles in found.items()}
