"""Places: an address and its table as one number, so that coil 1 and register 1 are different places everywhere.

A holding register's place is its address. Of the other tables the function that reads it stands above the sixteen bits
of the address: coil 0001H is 0x1_0001, discrete input 0001H 0x2_0001, input register 0001H 0x4_0001.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

__all__ = ["BITS", "TABLES", "WRITABLE", "Table", "place", "shown", "split"]

Table: TypeAlias = Literal["holding", "input", "coil", "discrete"]

TABLES = ("holding", "input", "coil", "discrete")
"""The four tables of the Modbus specification, the one that is meant where nothing is said first."""

BITS = ("coil", "discrete")
"""Tables of bits, each of which is read as 0 or 1."""

WRITABLE = ("holding", "coil")
"""Tables that can be written."""

_CODES = {"coil": 1, "discrete": 2, "holding": 0, "input": 4}

_NAMES = {code: table for table, code in _CODES.items()}

_CALLED = {"coil": "coil ", "discrete": "discrete input ", "holding": "", "input": "input register "}


def place(table: str | None, address: int) -> int:
    """The place of *address* (0..0xFFFF) in *table*; None is the holding registers."""
    return _CODES[table or "holding"] << 16 | address


def split(place: int) -> tuple[str, int]:
    """Table and address of *place*."""
    return _NAMES.get(place >> 16, "holding"), place & 0xFFFF


def shown(place: int) -> str:
    """*place* in words: `2000H`, `coil 0001H`."""
    table, address = split(place)
    return f"{_CALLED[table]}{address:04X}H"
