"""What is known about registers and parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from drivebus import tables
from drivebus.values.choices import Choice, Value, counted
from drivebus.values.faults import Evidence

__all__ = ["Description", "group_of"]

Access: TypeAlias = Literal["rw", "ro", "wo", "run", "stop", "unknown"]
"""Whether and when something may be written; see `Description`."""

Kind: TypeAlias = Literal["register", "parameter"]


@dataclass(frozen=True)
class Description:
    """Everything that is known about one register or parameter.

    Attributes:
        name: Its name, such as `"output_current"`, or its code if it has no other name.
        code: The parameter code, such as `"P00.11"`; None for registers.
        label: What it is, in words.
        kind: `"register"` or `"parameter"`.
        address: Where it is read, 0..0xFFFF; None where nobody knows that, and it cannot be used.
        table: The table it is in: `"holding"`, `"input"`, `"coil"` or `"discrete"`.
        unit: Engineering unit, empty for a plain number.
        scale: Raw counts per unit; no whole number where a share is counted: 163.84 where 16384 counts are 100 %.
        signed: Whether the word is two's complement.
        low, high: Range in engineering units; None where it is not known.
        low_from, high_from: The parameters that narrow the range on a given drive, or None.
        default: Factory value, or None.
        access: `"rw"`, `"ro"`, `"run"` (writable at any time), `"stop"` (only while stopped) or `"unknown"`.
        choices: Labels of the values, empty if they have none.
        bits: Labels of bit fields, or None.
        source: The document that says so.
        verified: Whether documents of this very family print all of it.
        evidence: `"verified"`, `"unverified"` (printed in part or for a sister series) or `"assumed"` (no document of
            the family prints it).
        note: What else is worth knowing; says what is missing where it is not verified.
        words: How many words it takes, 1 or 2.
        variant: What decides its unit, scale and range, such as `"speed_unit"`, or None.
        unverified_bits: Those of *bits* whose place in the word no document of this family prints.
        listed: Whether the profile has a row for it; else only its address is known, which follows from its code.
        high_first: Whether of two words the first is the high one.
    """

    name: str
    code: str | None
    label: str
    kind: Kind
    address: int | None
    unit: str
    scale: int | float
    signed: bool
    low: Any
    high: Any
    low_from: str | None
    high_from: str | None
    default: Any
    access: Access
    choices: Mapping[int, str]
    bits: Mapping[str, Mapping[int, str]] | None
    source: str
    verified: bool
    note: str
    evidence: Evidence = "verified"
    words: int = 1
    variant: str | None = None
    unverified_bits: tuple[str, ...] = ()
    listed: bool = True
    high_first: bool = False
    table: tables.Table = "holding"

    @property
    def place(self) -> int | None:
        """Table and address as one number: of a holding register its address, of a coil 0x1_0000 above it."""
        return None if self.address is None else tables.place(self.table, self.address)

    def number(self, words: Sequence[int]) -> int:
        """What *words* are together, as they stand one behind the other: the raw number that `decode` takes."""
        low_first = reversed(words) if self.high_first else words
        return sum(word << 16 * index for index, word in enumerate(low_first))

    @property
    def reason(self) -> str:
        """Why it is not verified; empty if it is."""
        return "" if self.verified else self.note

    @property
    def writable(self) -> bool:
        """Whether a write makes sense at all."""
        return self.access != "ro"

    @property
    def bounded(self) -> bool:
        """Whether it is known how far its values go, so that a wrong one is noticed here."""
        return self.high is not None or self.high_from is not None or self.variant is not None

    @property
    def group(self) -> str:
        """The group of a parameter, as its code says it; empty for a register."""
        return group_of(self.code or "")

    def text(self, value: Value) -> str:
        """*value* as people read it: with as many digits after the point as the drive counts, or with its label."""
        if isinstance(value, Choice):
            return f"{int(value)} = {value.label}"
        return counted(value, self.scale)


def group_of(code: str) -> str:
    """The group that the code of a parameter names: `P05` of P05.06, `C1` of C1-01, `ACC` of ACC."""
    return code.replace("-", ".").partition(".")[0]
