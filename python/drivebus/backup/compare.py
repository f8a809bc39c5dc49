"""How two sets of parameters differ: a file from another, from the drive, from what the factory set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import overload

from drivebus.backup.rules import Rules
from drivebus.backup.text import worded
from drivebus.errors import NotAllowed
from drivebus.profile import Profile
from drivebus.values import Choice, Value, counted

__all__ = ["Diff", "Difference", "Side", "amount", "compare", "factory", "shown"]


@dataclass(frozen=True)
class Difference:
    """One parameter that is not the same on both sides.

    Attributes:
        code: The parameter.
        label: What it is, in words.
        unit: Its engineering unit.
        left, right: Its value on each side; None where that has none.
        reason: Why one side has none, or empty.
    """

    code: str
    label: str
    unit: str
    left: Value | None
    right: Value | None
    reason: str = ""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        sides = ("none" if side is None else f"{shown(side)}{unit}" for side in (self.left, self.right))
        why = f" ({self.reason})" if self.reason else ""
        return f"{self.code} {self.label}: {' -> '.join(sides)}{why}"


class Diff(Sequence[Difference]):
    """The parameters that differ, in code order: empty, and false, if none differs.

    Attributes:
        left, right: What was compared, in words.
        compared: How many parameters were.
        uncompared: Why others were not, by code.
    """

    __slots__ = ("_differences", "compared", "left", "right", "uncompared")

    def __init__(
        self,
        differences: Sequence[Difference],
        left: str,
        right: str,
        compared: int,
        uncompared: Mapping[str, str],
    ) -> None:
        self._differences = tuple(differences)
        self.left = left
        self.right = right
        self.compared = compared
        self.uncompared: dict[str, str] = dict(uncompared)

    @overload
    def __getitem__(self, index: int) -> Difference: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Difference]: ...
    def __getitem__(self, index: int | slice) -> Difference | Sequence[Difference]:
        return self._differences[index]

    def __len__(self) -> int:
        return len(self._differences)

    def __str__(self) -> str:
        lines = [f"{self.left} -> {self.right}: {len(self)} of {self.compared} parameters differ"]
        return "\n".join([*lines, *map(str, self)])

    def __repr__(self) -> str:
        return f"<Diff of {self.left} and {self.right}: {len(self)} of {self.compared} parameters differ>"


@dataclass(frozen=True)
class Side:
    """One side of a comparison.

    Attributes:
        name: What it is, in words.
        raw: The word of each parameter that it has.
        unread: Why it has no others.
        partial: Why what it lacks says nothing, where it knows some parameters only; else empty.
    """

    name: str
    raw: Mapping[str, int]
    unread: Mapping[str, str]
    partial: str = ""

    def lacks(self, code: str) -> str:
        """Why it has no *code*."""
        return self.partial or self.unread.get(code, f"{self.name} does not have it")


def compare(profile: Profile, left: Side, right: Side, *, everything: bool = False) -> Diff:
    """How *left* and *right*, in the words of one profile, differ.

    What tells nothing about how a drive is set (its fault history, what can only be read) is left out, unless
    *everything*.
    """
    rules = Rules(profile)
    differences: list[Difference] = []
    uncompared: dict[str, str] = {}
    compared = 0
    for code in sorted({*left.raw, *right.raw}, key=rules.place):
        reason = None if everything else rules.uncompared(code)
        sides = (left.raw.get(code), right.raw.get(code))
        lacking = next((side for side, word in zip((left, right), sides, strict=True) if word is None), None)
        if reason is None and lacking is not None and lacking.partial:
            reason = lacking.lacks(code)
        if reason is not None:
            uncompared[code] = reason
            continue
        compared += 1
        if sides[0] == sides[1]:
            continue
        known = profile.describe(code)
        values = [None if word is None else worded(profile, code, word) for word in sides]
        why = "" if lacking is None else lacking.lacks(code)
        differences.append(Difference(code, known.label, known.unit, values[0], values[1], why))
    return Diff(differences, left.name, right.name, compared, uncompared)


def factory(profile: Profile) -> Side:
    """What the factory set, as far as the profile knows."""
    raw = {}
    for code in Rules(profile).codes():
        default = profile.describe(code).default
        if default is None:
            continue
        try:
            raw[code] = profile.encode(code, default)
        except NotAllowed:
            continue
    return Side("factory defaults", raw, {}, partial="its factory value is not known")


def shown(value: Value) -> str:
    """*value* for people; a choice with its number."""
    return f"{int(value)} = {value.label}" if isinstance(value, Choice) else str(value)


def amount(profile: Profile, code: str, value: Value) -> str:
    """*value* of *code* with its unit."""
    known = profile.describe(code)
    text = shown(value) if isinstance(value, Choice) else counted(value, known.scale)
    return f"{text} {known.unit}".rstrip()
