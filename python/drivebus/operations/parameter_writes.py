"""Sends the writes that are allowed, alone or in one frame, and remembers to which memory of the drive.

What is allowed is decided in `parameters`. A drive tells the value in force and not where it is kept.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import NamedTuple

from drivebus.advice import Advice, Text
from drivebus.errors import LINE_ERRORS, Refused, StoreWarning, level_of_the_program
from drivebus.operations import raw_words, registers
from drivebus.operations.drive_view import DriveView
from drivebus.values import Description

__all__ = ["Planned", "is_in_ram", "key", "put_in_ram", "stored", "write"]

_STORES_BEFORE_WARNING = 5
"""EEPROM writes of one parameter by one program that are taken for use; more look like a loop."""


class Planned(NamedTuple):
    """One write that is allowed, as far as the profile tells."""

    known: Description
    name: str
    address: int
    raw: int


async def write(unit: DriveView, run: Sequence[Planned], store: bool) -> None:
    """Sends the writes of *run*, whose addresses follow each other, by one request.

    What EEPROM has already is left out, and the rest goes by as few requests as it takes.
    """
    if not store or any(item.known.kind != "parameter" for item in run):
        for item in run:
            if item.known.kind == "parameter":
                put_in_ram(unit, item.known)
        await _send(unit, run, unit.profile.read_back(run[0].name))
        return
    # What is read is what is in force. It tells about EEPROM only if RAM was not written since.
    in_force = await raw_words.read_words(unit, unit.profile.address(run[0].name), len(run))
    left: list[Planned] = []
    is_told = True
    for item, word in zip(run, in_force, strict=True):
        if word == item.raw and not is_in_ram(unit, item.name):
            await _store(unit, left, is_told)
            left, is_told = [], True
        else:
            left.append(item)
            is_told = is_told and word != item.raw
    await _store(unit, left, is_told)


async def _store(unit: DriveView, run: Sequence[Planned], is_told: bool) -> None:
    """Writes *run* to EEPROM; whether reading would tell that EEPROM took it *is told*."""
    if not run:
        return
    # What is in force already, from RAM, reads the same whether EEPROM took it or not.
    await _send(unit, run, unit.profile.read_back(run[0].name) if is_told else None)
    for item in run:
        stored(unit, item.known)


async def _send(unit: DriveView, run: Sequence[Planned], read_back: int | None) -> None:
    if len(run) == 1:
        await raw_words.write(unit, run[0].address, run[0].raw, read_back=read_back, absolute=True)
        return
    try:
        await raw_words.write(unit, run[0].address, [item.raw for item in run], read_back=read_back, absolute=True)
    except Refused as error:
        # Whether a drive takes none of the words then, or those before the wrong one, is not printed.
        if hasattr(error, "add_note"):
            error.add_note(await _shown(unit, run))
        raise


async def _shown(unit: DriveView, run: Sequence[Planned]) -> str:
    """What the drive shows of *run*, for people."""
    together = f"{', '.join(item.name for item in run)} shared that request"
    try:
        shown = await raw_words.read_words(unit, unit.profile.address(run[0].name), len(run))
    except LINE_ERRORS as error:
        return f"{together}; what the drive took of it could not be read: {error}"
    values = (
        f"{item.name} = {registers.value(unit, item.name, word):g} {item.known.unit}".rstrip()
        for item, word in zip(run, shown, strict=True)
    )
    return f"{together}. In force in the drive now: {', '.join(values)}"


def is_in_ram(unit: DriveView, name: str) -> bool:
    """Whether this program wrote *name* to RAM, and not to EEPROM since: what it reads as is then not stored."""
    return key(unit.profile.describe(name)) in unit.record.in_ram


def put_in_ram(unit: DriveView, known: Description) -> None:
    """Says that a parameter is about to be written to RAM: the drive may take it although its answer is lost."""
    unit.record.in_ram.add(key(known))


def stored(unit: DriveView, known: Description) -> None:
    """Says that a parameter was written to EEPROM, and warns of a program that does that in a loop."""
    name = key(known)
    unit.record.in_ram.discard(name)
    unit.record.stores[name] += 1
    times = unit.record.stores[name]
    if times >= _STORES_BEFORE_WARNING:
        warnings.warn(
            StoreWarning(
                Text(
                    f"{name} of unit {unit.address} was stored in EEPROM {times} times by this program; its write life "
                    "is limited: ",
                    Advice("to_ram", None, "write to RAM (store=False) in a loop"),
                )
            ),
            stacklevel=level_of_the_program(),
        )


def key(known: Description) -> str:
    """One name for a parameter that has two."""
    return known.code or known.name
