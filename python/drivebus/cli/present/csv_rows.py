"""Samples as CSV, in the form that every command writes: a moment in UTC, and values with their digits."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from typing import TextIO

import drivebus
from drivebus.cli.present.moments import moment
from drivebus.cli.present.output import printable

__all__ = ["CsvRows", "titled"]


class CsvRows:
    """The samples of one drive, a line each, behind one with the names of the columns.

    Args:
        file: Where they go. Each line is there at once, for whoever reads along.
        rows: What each value is, by its name.
        doubtful: What is not verified of them, and how.
    """

    def __init__(
        self, file: TextIO, rows: Mapping[str, drivebus.Description], doubtful: Mapping[str, str] | None = None
    ) -> None:
        self._file = file
        self._rows = rows
        self._csv = csv.writer(file, lineterminator="\n")
        titles = [titled(row, (doubtful or {}).get(name, "")) for name, row in rows.items()]
        self._csv.writerow(["time", *map(printable, titles), "missing"])
        file.flush()

    def write(self, time: float, values: Mapping[str, float]) -> None:
        """One sample, at a Unix time in seconds."""
        self._csv.writerow([moment(time), *(printable(row.text(values[name])) for name, row in self._rows.items()), ""])
        self._file.flush()


def titled(row: drivebus.Description, doubt: str) -> str:
    """The name of a column: with the unit of its values, and with what makes them not sure."""
    known = ", ".join(text for text in (row.unit, doubt) if text)
    return f"{row.name} [{known}]" if known else row.name
