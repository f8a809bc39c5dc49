"""Faults of a drive, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from drivebus.values.choices import Value

__all__ = ["Evidence", "Fault"]

Evidence: TypeAlias = Literal["verified", "unverified", "assumed"]
"""How well documents prove something; see `Description`."""


@dataclass(frozen=True)
class Fault:
    """One fault of a drive.

    Attributes:
        code: The fault's number in the drive.
        mnemonic: What the keypad shows, such as `"OL1"`.
        label: What it means, in words.
        cause: What may have caused it; empty if no manual says so.
        remedy: What to do about it; empty if no manual says so.
        verified: Whether number and meaning were printed for this very family.
        evidence: `"verified"`, `"unverified"` (printed in part or for a sister series) or `"assumed"`.
        note: What else is known about it; says what is missing where it is not verified.
        values: What the drive saw when it tripped, by parameter; a `Snapshot` with units. Empty where it keeps none.
    """

    code: int
    mnemonic: str
    label: str
    cause: str = ""
    remedy: str = ""
    verified: bool = True
    evidence: Evidence = "verified"
    note: str = ""
    values: Mapping[str, Value] = field(default_factory=dict, compare=False)

    def __str__(self) -> str:
        text = f"{self.mnemonic} ({self.code}): {self.label}" if self.mnemonic else f"{self.code}: {self.label}"
        return text if self.verified else f"{text} [unverified]"
