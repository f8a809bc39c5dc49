"""To which memory of a drive its parameters were written.

A drive tells the value in force and not where it is kept, so that is remembered: what was written to RAM is not stored,
and what is stored again and again wears the EEPROM.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from drivebus._native import STORES_BEFORE_NOTICE
from drivebus.advice import Advice, Text
from drivebus.errors import StoreWarning, level_of_the_program
from drivebus.operations.drive_view import DriveView

if TYPE_CHECKING:
    from drivebus.profile import Profile
    from drivebus.values import Description

__all__ = ["is_in_ram", "key", "put_in_ram", "store_register", "stored", "warn_of_wear"]


def is_in_ram(unit: DriveView, name: str) -> bool:
    """Whether this program wrote *name* to RAM, and not to EEPROM since: what it reads as is then not stored."""
    return unit.record.sent.is_in_ram(key(unit.profile.describe(name)))


def put_in_ram(unit: DriveView, known: Description) -> None:
    """Says that a parameter is about to be written to RAM: the drive may take it although its answer is lost."""
    unit.record.sent.put_in_ram(key(known))


def stored(unit: DriveView, known: Description) -> None:
    """Says that a parameter was written to EEPROM, and warns of a program that does that in a loop."""
    name = key(known)
    times = unit.record.sent.stored(name)
    if times >= STORES_BEFORE_NOTICE:
        warn_of_wear(unit, name, times)


def warn_of_wear(unit: DriveView, name: str, times: int) -> None:
    """Warns of a program that stored the parameter *name* so many *times*."""
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


def store_register(profile: Profile) -> str | None:
    """The register whose word stores all that is in RAM; None where what is written is kept, or not, by its address."""
    memory = profile.memory()
    return None if memory is None else memory.store_register


def key(known: Description) -> str:
    """One name for a parameter that has two."""
    return known.code or known.name
