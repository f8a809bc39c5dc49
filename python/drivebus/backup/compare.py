"""How two sets of parameters differ: a file from another, from the drive, from what the factory set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import overload

from drivebus.backup.rules import Rules
from drivebus.backup.text import worded
from drivebus.backup.unread import Unread, in_words, is_open
from drivebus.errors import NotAllowed
from drivebus.profile import Profile
from drivebus.values import Choice, Value, counted

__all__ = ["Diff", "Difference", "Side", "amount", "compare", "factory", "shown"]


_UNTOLD = ("closed", "refused", "lost")
"""Why a side has no value that it may have all the same."""


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
    """The parameters that differ, in code order: empty if none differs, and false if it is complete, too.

    Attributes:
        left, right: What was compared, in words.
        compared: How many parameters were.
        uncompared: Why others were not, by code.
        complete: Whether nothing was left out because it was lost, or refused for a reason that says nothing of the
            drive. A diff that is not complete is never false.
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

    def __bool__(self) -> bool:
        return bool(self._differences) or not self.complete

    @property
    def complete(self) -> bool:
        """See the class."""
        return not self.unsettled()

    def unsettled(self) -> dict[str, Unread]:
        """What was lost, or refused for a reason that says nothing of the drive, and so not compared: why, by code."""
        return {code: why for code, why in self.uncompared.items() if isinstance(why, Unread) and why.open}

    def __str__(self) -> str:
        rest = [f"{code}: not compared, {why.why}: {why}" for code, why in self.unsettled().items()]
        return "\n".join([self._head(), *map(str, self), *rest])

    def __repr__(self) -> str:
        return f"<Diff of {self._head()}>"

    def _head(self) -> str:
        lost = self.unsettled()
        rest = f", {len(lost)} could not be compared: {in_words(lost.values())}" if lost else ""
        return f"{self.left} -> {self.right}: {len(self)} of {self.compared} parameters differ{rest}"


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

    def closed(self) -> set[str]:
        """What it has, or may have, and did not tell: that is no difference."""
        return {code for code, why in self.unread.items() if isinstance(why, Unread) and why.why in _UNTOLD}

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
    for code in sorted({*left.raw, *right.raw, *left.closed(), *right.closed()}, key=rules.place):
        sides = (left.raw.get(code), right.raw.get(code))
        lacking = [side for side, word in zip((left, right), sides, strict=True) if word is None]
        reason = (None if everything else rules.uncompared(code)) or _untold(code, lacking)
        if reason is not None:
            uncompared[code] = reason
            continue
        compared += 1
        if sides[0] == sides[1]:
            continue
        known = profile.describe(code)
        values = [None if word is None else worded(profile, code, word) for word in sides]
        why = lacking[0].lacks(code) if lacking else ""
        differences.append(Difference(code, known.label, known.unit, values[0], values[1], why))
    return Diff(differences, left.name, right.name, compared, uncompared)


def _untold(code: str, lacking: Sequence[Side]) -> str | None:
    """Why *code* cannot be compared where the sides *lacking* have no value of it; None if that is a difference."""
    partial = next((side.partial for side in lacking if side.partial), None)
    untold = [side.lacks(code) for side in lacking if code in side.closed()]
    return partial or next(filter(is_open, untold), None) or next(iter(untold), None)


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
