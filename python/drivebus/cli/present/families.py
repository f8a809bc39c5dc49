"""The families that are known, the rules of one, and what is wrong with a profile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import drivebus
from drivebus.cli.present import profile_rules
from drivebus.cli.present.output import Output

__all__ = ["KINDS", "Families", "FamilyRules", "Mistakes"]

KINDS = ("registers", "parameters", "faults")


@dataclass(frozen=True)
class Families:
    """Families, with how many rows each has, and how many of them are proved."""

    profiles: Sequence[drivebus.Profile]

    def records(self) -> Iterator[dict[str, Any]]:
        """Each of them, with its rows by kind."""
        for profile in self.profiles:
            counts = profile.counts()
            yield {
                "name": profile.name,
                "title": profile.title,
                "maker": profile.maker,
                "models": profile.models,
                "aliases": [alias.name for alias in profile.aliases()],
                "kind": profile.kind,
                **{kind: counts[kind]["total"] for kind in KINDS},
                "verified": _printed(counts),
                **{how: sum(counts[kind][how] for kind in KINDS) for how in ("unverified", "assumed")},
            }

    def lay_out(self, out: Output) -> None:
        """The same, with all rows of a family in one number."""
        rows = []
        for profile in self.profiles:
            counts = profile.counts()
            share = _printed(counts)
            total = sum(counts[kind]["total"] for kind in KINDS)
            title = profile.title.removeprefix(profile.maker).strip()
            rows.append([profile.name, profile.maker, title, total, "" if share is None else f"{int(share * 100)} %"])
        out.rows(["name", "maker", "title", "rows", "verified"], rows)
        for profile in self.profiles:
            for alias in profile.aliases():
                out.say(f"{alias.name}: take {profile.name}; `drivebus profiles show {profile.name}` says why.")
        out.say(
            "rows: registers, parameters and faults that are known. verified: those that a document of this very "
            "family prints. `drivebus profiles show NAME` counts those that are unverified and assumed, and has more."
        )


def _printed(counts: dict[str, dict[str, int]]) -> float | None:
    """The share of rows that a document of the family itself prints, 0.0 to 1.0; None where there are no rows."""
    total = sum(counts[kind]["total"] for kind in KINDS)
    doubtful = sum(counts[kind]["unverified"] + counts[kind]["assumed"] for kind in KINDS)
    return round((total - doubtful) / total, 3) if total else None


@dataclass(frozen=True)
class FamilyRules:
    """The rules of a family, and how well its rows are known."""

    profile: drivebus.Profile

    def records(self) -> Iterator[dict[str, Any]]:
        """All of it in one object."""
        yield {**profile_rules.known(self.profile), "counts": self.profile.counts()}

    def lay_out(self, out: Output) -> None:
        """The same in words."""
        for title, lines in profile_rules.in_words(self.profile):
            out.heading(title)
            for line in lines:
                out.say(f"  {line}")
        out.heading("Rows, and how well they are known")
        counts = self.profile.counts()
        out.rows(profile_rules.COUNTED, [profile_rules.counted(kind, counts[kind]) for kind in KINDS])


@dataclass(frozen=True)
class Mistakes:
    """What is wrong with a profile, each with its file and its line."""

    problems: Sequence[dict[str, Any]]

    def records(self) -> Iterator[dict[str, Any]]:
        """Each of them."""
        yield from self.problems

    def lay_out(self, out: Output) -> None:
        """A line for each."""
        for problem in self.problems:
            line = "" if problem["line"] is None else f", line {problem['line']}"
            out.say(f"{problem['file']}{line}: {problem['reason']}")
