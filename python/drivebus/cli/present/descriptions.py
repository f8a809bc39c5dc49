"""What is known of registers and parameters: one of them, those that match, those of a group, and the groups."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import drivebus
from drivebus import tables
from drivebus.cli.present.output import Output, counted

__all__ = ["Description", "Group", "Groups", "Matches"]

_MATCHES = 20
"""Most rows that a search shows: who has more of them asks for something narrower."""

_WRITABLE = {
    "run": "any time",
    "rw": "any time",
    "stop": "only while the motor is stopped",
    "ro": "no",
    "wo": "any time; it cannot be read",
    "unknown": "yes; not known whether also while the motor runs",
}
"""When a value can be written, by its access."""

_FOR_PROGRAMS = ("kind", "table", "words", "scale", "signed", "high_first", "access", "listed")
"""What people rarely ask for."""

_CHOICES = 3
"""Most choices that a row of a list shows; `describe` has them all."""


def _address(row: drivebus.Description) -> str | None:
    return None if row.place is None else tables.shown(row.place)


@dataclass(frozen=True)
class Description:
    """All that is known of one register or parameter.

    Attributes:
        known: That.
        everything: Whether people see what only programs need, too.
    """

    known: drivebus.Description
    everything: bool = False

    def records(self) -> Iterator[dict[str, Any]]:
        """All of it, by name."""
        yield {**vars(self.known), "address": _address(self.known)}

    def lay_out(self, out: Output) -> None:
        """The same in words, and where its range is not printed, that."""
        known = self.known
        writable = _WRITABLE[known.access]
        if known.writable and known.verified and not known.bounded:
            printed = ", but for its choices," if known.choices else ""
            writable += f"; its range is not printed, so a write{printed} needs --unverified"
        values = {
            "name": known.name,
            "code": known.code,
            "label": known.label,
            "address": _address(known),
            "unit": known.unit,
            "range": "" if known.choices else _range(known),
            "limited by": " and ".join(code for code in (known.low_from, known.high_from) if code),
            "default": None if known.default is None else known.text(known.default),
            "writable": writable,
            "choices": ", ".join(f"{number} = {label}" for number, label in known.choices.items()),
            "bits": ", ".join(known.bits or {}),
            "unverified bits": ", ".join(known.unverified_bits),
            "depends on": known.variant,
            "note": known.note,
            "evidence": known.evidence,
            "source": known.source,
        }
        if self.everything:
            values |= {name: value for name, value in vars(known).items() if name in _FOR_PROGRAMS}
        out.facts(values)


@dataclass(frozen=True)
class Matches:
    """The rows of *profile* that match what was *wanted*, the best first."""

    profile: drivebus.Profile
    wanted: str
    found: Sequence[drivebus.Description]

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {
                "name": row.name,
                "code": row.code,
                "address": _address(row),
                "unit": row.unit,
                "label": row.label,
                "evidence": row.evidence,
            }
            for row in self.found[:_MATCHES]
        ]

    def records(self) -> Iterator[dict[str, Any]]:
        """The best of them."""
        yield from self._rows()

    def lay_out(self, out: Output) -> None:
        """The same in a table, and how many there are."""
        best = str(vars(self.found[0])).lower()
        matches = "match" if len(self.found) == 1 else "matches"
        if all(word in best for word in self.wanted.lower().split()):
            count = f"{len(self.found)} {matches}"
        else:
            count = f"nothing called that, but {len(self.found)} near {matches}"
        narrower = f", the best {_MATCHES} of them; more words narrow it" if len(self.found) > _MATCHES else ""
        out.say(f'{self.profile.name} has {count} for "{self.wanted}"{narrower}:')
        rows = self._rows()
        out.rows(list(rows[0]), [list(row.values()) for row in rows])


@dataclass(frozen=True)
class Group:
    """The *rows* of a group.

    Attributes:
        title: Of the family, and of the group.
        rows: What is in it.
        unlisted: What is said of codes in it that have no row; empty for nothing.
    """

    title: str
    rows: Sequence[drivebus.Description]
    unlisted: str

    def _columns(self) -> Iterator[dict[str, Any]]:
        for row in sorted(self.rows, key=lambda row: (row.kind == "parameter", row.address is None, row.address)):
            yield {
                "name": row.name,
                "code": row.code,
                "address": _address(row),
                "unit": row.unit,
                "range": _range(row),
                "access": row.access,
                "label": row.label,
            }

    def records(self) -> Iterator[dict[str, Any]]:
        """Each row."""
        yield from self._columns()

    def lay_out(self, out: Output) -> None:
        """The same in a table."""
        out.say(f"{self.title}: {counted(len(self.rows), 'row')}")
        rows = [list(row.values()) for row in self._columns()]
        # A code says which it is as well as a name does; what has none is known by its name alone.
        coded = all(row.code is not None for row in self.rows)
        spare = ("address", "name", "access") if coded else ("code", "access", "address")
        out.rows(["name", "code", "address", "unit", "range", "access", "label"], rows, spare)
        if self.unlisted:
            out.say(self.unlisted)


def _range(row: drivebus.Description) -> str:
    if row.choices:
        shown = [f"{number} = {label}" for number, label in row.choices.items()]
        more = f", … ({len(shown)} choices)" if len(shown) > _CHOICES else ""
        return ", ".join(shown[:_CHOICES]) + more
    if row.low is None or row.high is None:
        return ""
    return f"{row.text(row.low)} to {row.text(row.high)}"


@dataclass(frozen=True)
class Groups:
    """The groups of a family, with how many names each has, and the first of them."""

    title: str
    count: int
    groups: Sequence[tuple[str, int, str]]

    def records(self) -> Iterator[dict[str, Any]]:
        """Each of them."""
        for name, count, such_as in self.groups:
            yield {"group": name, "names": count, "such as": such_as}

    def lay_out(self, out: Output) -> None:
        """The same in a table."""
        out.say(f"{self.title}: {counted(self.count, 'name')}; `drivebus list GROUP` shows those of a group")
        out.rows(["group", "names", "such as"], self.groups)
