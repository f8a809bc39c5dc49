"""Each row of a profile, read once from the drive that is there: what a manual and a drive do not agree on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import drivebus
from drivebus import tables

__all__ = ["RowRead", "read_rows"]


class RowRead(NamedTuple):
    """What came of one row.

    Attributes:
        name: The code of a parameter, else the name of a register.
        place: Where it is.
        value: What the drive has there, as people write it; what it refused by, where it did.
        unit: What it counts in.
        label: What it is.
        is_there: Whether the drive did not refuse it.
    """

    name: str
    place: str
    value: str
    unit: str
    label: str
    is_there: bool


def read_rows(drive: drivebus.Drive) -> Iterator[RowRead]:
    """Reads whatever *drive* may have, and has been named, one row a request: one that is refused hides no other.

    Raises:
        NoAnswer, BadAnswer, PortError: The line failed.
    """
    for name in drive.profile.names():
        row = drive.describe(name)
        if row.place is None or row.access == "wo":
            continue
        is_there = True
        try:
            said = row.text(drive.read(name, unverified=True))
        except drivebus.Refused as error:
            said, is_there = f"refused by {error.code:02X}H ({error.name.replace('_', ' ')})", False
        except drivebus.NotAllowed as error:
            said = f"not known: {error.text}"
        yield RowRead(row.code or name, tables.shown(row.place), said, row.unit, row.label, is_there)
