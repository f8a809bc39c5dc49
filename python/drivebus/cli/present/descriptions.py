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


def _address(row: drivebus.Description) -> str | None:
    return None if row.place is None else tables.shown(row.place)


@dataclass(frozen=True)
class Description:
    """All that is known of one register or parameter."""

    known: drivebus.Description

    def records(self) -> Iterator[dict[str, Any]]:
        """All of it, by name."""
        yield {**vars(self.known), "address": _address(self.known)}

    def lay_out(self, out: Output) -> None:
        """The same, and where its range is not printed, that."""
        known = self.known
        values = {
            **vars(known),
            "address": _address(known),
            "choices": ", ".join(f"{number} = {label}" for number, label in known.choices.items()),
            "bits": ", ".join(known.bits or {}),
            "unverified_bits": ", ".join(known.unverified_bits),
        }
        del values["verified"]  # `evidence` says more
        if known.writable and known.verified and not known.bounded:
            printed = " but for its choices" if known.choices else ""
            values["write"] = f"unverified{printed}: its range is not printed"
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
            count = f"nothing that is called so, and {len(self.found)} near {matches}"
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
        out.rows(["name", "code", "address", "unit", "range", "access", "label"], rows)
        if self.unlisted:
            out.say(self.unlisted)


def _range(row: drivebus.Description) -> str:
    if row.choices:
        return f"{len(row.choices)} choices"
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
