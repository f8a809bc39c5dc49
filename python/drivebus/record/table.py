"""The one table that every format of a recording has: its columns, its rows, and what is told of the drives in it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any, NamedTuple

from drivebus.profile import Profile
from drivebus.values import Choice, Description, Value

__all__ = ["ELAPSED", "FIXED", "Column", "Recorded", "Row", "Table", "moment", "seconds_of"]

FIXED = ("time", "drive", "event", "text", "state")
"""The columns in front of the values. `event` is empty where a row has values."""


ELAPSED = "t [s]"
"""The column of CSV files behind those: seconds since the recording began."""


class Row(NamedTuple):
    """One row.

    Attributes:
        time: Unix time in seconds.
        drive: Whose it is; empty of what is of no drive.
        event: What happened; empty where the row has values.
        text: What there is to say of that.
        state: What the drive is doing; empty where that is not known.
        values: One for each column of values; None where there is none.
    """

    time: float
    drive: str
    event: str
    text: str = ""
    state: str = ""
    values: tuple[Value | str | None, ...] = ()


class Column(NamedTuple):
    """A column of values.

    Attributes:
        title: The name of the register, with its unit in brackets if it has one: `output_current [A]`.
        name: The name of the register, or its address such as `0x3000`.
        unit: The unit, or nothing.
        in_words: Whether its values are words: what the drive calls its numbers.
    """

    title: str
    name: str
    unit: str
    in_words: bool


@dataclass(frozen=True, slots=True)
class Recorded:
    """One drive that is recorded.

    Attributes:
        label: What it is called in the file.
        unit: Its address, 1..247.
        line: The name of its port and its settings.
        profile: What its words mean.
        rows: What is known of each value that is recorded, by name.
        state, fault: The registers that tell them; None where no register may be read for it.
        asked: All that is asked of it.
    """

    label: str
    unit: int
    line: str
    profile: Profile
    rows: Mapping[str, Description]
    state: str | None
    fault: str | None

    @property
    def asked(self) -> list[str]:
        """The names that are asked for in each cycle."""
        return list(dict.fromkeys([*self.rows, *(name for name in (self.state, self.fault) if name is not None)]))


class Table:
    """The columns of a recording of *drives*.

    Args:
        drives: Whose values there are.
        interval: Seconds between two samples of a drive; None: as fast as the line allows.
        version: Of drivebus.

    Attributes:
        columns: Those of values.
        titles: Of all columns.
        began: Unix time in seconds at which the recording began, that is its first file; 0 before.
    """

    def __init__(self, drives: Sequence[Recorded], interval: float | None, version: str) -> None:
        known: dict[str, Column] = {}
        for drive in drives:
            for name, row in drive.rows.items():
                column = _column(name, row)
                known.setdefault(column.title, column)
        self.columns = list(known.values())
        self.titles = [*FIXED, *known]
        self.began = 0.0
        self._places = {
            drive.label: [drive.rows.get(column.name) if _owns(drive, column) else None for column in self.columns]
            for drive in drives
        }
        self._about: dict[str, Any] = {
            "drivebus": version,
            "interval": interval,
            "drives": [_about(drive) for drive in drives],
        }

    def in_words(self) -> str:
        """What is recorded, for whoever opens the file: `drivebus VERSION, every 0.5 s: pump (gd350)`."""
        rate = "as fast as the line allows" if self._about["interval"] is None else f"every {self._about['interval']} s"
        drives = ", ".join(f"{drive['name']} ({drive['profile']})" for drive in self._about["drives"])
        return f"drivebus {self._about['drivebus']}, {rate}: {drives}"

    def about(self, started: float) -> str:
        """What is told of a file that begins at *started*, as JSON: drives, lines, profiles, registers."""
        self.began = self.began or started
        return json.dumps({"started": moment(started), **self._about}, ensure_ascii=False)

    def values(self, label: str, sample: Mapping[str | int, Value]) -> tuple[Value | str | None, ...]:
        """The values of *sample*, each at the place of its column."""
        return tuple(
            None if row is None else _stored(column, sample[column.name])
            for column, row in zip(self.columns, self._places[label], strict=True)
        )

    def text(self, row: Row) -> list[str]:
        """*row* as text, with as many digits as the drive counts."""
        places = self._places.get(row.drive, ())
        shown = (_as_text(value, known) for value, known in zip(row.values, places, strict=False))
        told = [moment(row.time), row.drive, row.event, row.text, row.state, *shown]
        return told + [""] * (len(self.titles) - len(told))


def moment(time: float) -> str:
    """Unix seconds as ISO 8601 in UTC, with microseconds."""
    return datetime.fromtimestamp(time, timezone.utc).isoformat(timespec="microseconds")


def seconds_of(text: str) -> float:
    """What `moment` wrote, as Unix seconds.

    Raises:
        ValueError: It is no such text.
    """
    return datetime.fromisoformat(text).timestamp()


def _column(name: str, row: Description) -> Column:
    return Column(f"{name} [{row.unit}]" if row.unit else name, name, row.unit, bool(row.choices))


def _owns(drive: Recorded, column: Column) -> bool:
    row = drive.rows.get(column.name)
    return row is not None and _column(column.name, row) == column


def _stored(column: Column, value: Value) -> Value | str:
    if not column.in_words:
        return value
    return value.label if isinstance(value, Choice) else str(value)


def _as_text(value: Value | str | None, known: Description | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, str) or known is None else str(known.text(value))


def _about(drive: Recorded) -> dict[str, Any]:
    registers = {
        name: {
            "label": row.label,
            "unit": row.unit,
            "address": row.address,
            "evidence": row.evidence,
            **({"bits": _bits(drive.profile, name, row.bits)} if row.bits else {}),
        }
        for name, row in drive.rows.items()
    }
    return {
        "name": drive.label,
        "unit": drive.unit,
        "line": drive.line,
        "profile": drive.profile.name,
        "registers": registers,
    }


def _bits(profile: Profile, name: str, fields: Mapping[str, Mapping[int, str]]) -> dict[str, dict[str, Any]]:
    """What the bits of a word mean, so that the file says it without the profile: mask and labels of each field."""
    dark = profile.fields(name, 0)
    shown = [profile.fields(name, 1 << bit) for bit in range(16)]
    return {
        field: {
            "mask": sum(1 << bit for bit, lit in enumerate(shown) if lit[field] != dark[field]),
            "labels": {str(value): label for value, label in labels.items()},
        }
        for field, labels in fields.items()
    }
