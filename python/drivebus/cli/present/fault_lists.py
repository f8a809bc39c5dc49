"""Faults: the present one, those that a drive remembers, and those that families know."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import drivebus
from drivebus.cli.present.output import Output

__all__ = ["FaultHistory", "FaultsByFamily", "KnownFaults"]

_COLUMNS = ["code", "mnemonic", "label", "cause", "remedy", "verified"]


def _row(fault: drivebus.Fault) -> list[Any]:
    return [fault.code, fault.mnemonic, fault.label, fault.cause, fault.remedy, fault.verified]


def _by_column(fault: drivebus.Fault) -> dict[str, Any]:
    return dict(zip(_COLUMNS, _row(fault), strict=True))


@dataclass(frozen=True)
class FaultHistory:
    """What a drive says of its faults.

    Attributes:
        present: The fault that it has now; None for none, or where that is not known.
        unknown: Why that is not known; None where it is.
        past: The last ones, the latest first.
        is_kept: Whether it is known where the family keeps its last faults.
        described: What is known of the values that the drive kept.
    """

    present: drivebus.Fault | None
    unknown: str | None
    past: Sequence[drivebus.Fault]
    is_kept: bool
    described: Mapping[str, drivebus.Description]

    def _numbered(self) -> list[tuple[str, drivebus.Fault]]:
        return [("last" if number == 0 else f"{number} before", fault) for number, fault in enumerate(self.past)]

    def records(self) -> Iterator[dict[str, Any]]:
        """Each fault, and when it was."""
        if self.unknown is not None:
            yield {"when": "now", "missing": self.unknown}
        elif self.present is None:
            yield {"when": "now", "code": None, "label": "no fault"}
        listed = [] if self.present is None else [("now", self.present)]
        for when, fault in [*listed, *self._numbered()]:
            yield {"when": when, **_by_column(fault), "values": dict(fault.values)}

    def lay_out(self, out: Output) -> None:
        """The present one with its cause and its remedy, the last ones in a table."""
        if self.unknown is not None:
            out.say(f"The present fault is not known: {self.unknown}")
        else:
            out.say("No fault now." if self.present is None else f"Now: {self.present}")
        if self.present is not None:
            out.facts(_told_of(self.present))
        if not self.is_kept:
            out.say("Where this family keeps its last faults is not known.")
            return
        if not self.past:
            out.say("The history is empty, or may not be read.")
            return
        out.say("History, the latest first:")
        out.rows(["when", *_COLUMNS], [[when, *_row(fault)] for when, fault in self._numbered()])
        if self.past[0].values:
            out.say("What the drive saw at the last one:")
            known = [(value, self.described[name]) for name, value in self.past[0].values.items()]
            rows = [[row.code or row.name, value, row.unit, row.label] for value, row in known]
            out.rows(["parameter", "value", "unit", "label"], rows)


def _told_of(fault: drivebus.Fault) -> dict[str, str]:
    return {"cause": fault.cause, "remedy": fault.remedy, "note": fault.note}


@dataclass(frozen=True)
class KnownFaults:
    """Faults of one family; one alone is told with all that is known of it, if it was *sought*."""

    faults: Sequence[drivebus.Fault]
    sought: bool

    def records(self) -> Iterator[dict[str, Any]]:
        """Each of them."""
        yield from map(_by_column, self.faults)

    def lay_out(self, out: Output) -> None:
        """A table, or all that is known of one."""
        if self.sought and len(self.faults) == 1:
            out.say(str(self.faults[0]))
            out.facts(_told_of(self.faults[0]))
            return
        if not self.faults:
            out.say("No fault of this family is known by number; the drive's manual has them.")
        out.rows(_COLUMNS, map(_row, self.faults))


class FaultsByFamily:
    """Faults of several families, each with those that have it: families of one maker have most in common."""

    def __init__(self, found: Iterable[tuple[str, drivebus.Fault]]) -> None:
        self._families: dict[tuple[Any, ...], list[str]] = {}
        for name, fault in found:
            self._families.setdefault(tuple(_row(fault)[:-1]), []).append(name)

    def records(self) -> Iterator[dict[str, Any]]:
        """Each of them, and the families."""
        for row, names in self._families.items():
            yield {"families": names, **dict(zip(_COLUMNS, row, strict=False))}

    def lay_out(self, out: Output) -> None:
        """The same, with cause and remedy."""
        for (code, mnemonic, label, cause, remedy), names in self._families.items():
            out.say(f"{code} {mnemonic}: {label} ({', '.join(names)})".replace(" :", ":"), "bold")
            out.facts({"cause": cause, "remedy": remedy})
