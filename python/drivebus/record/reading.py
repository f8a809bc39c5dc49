"""Recordings read back, whichever format they have."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from drivebus import checks
from drivebus.errors import BadArgument, NotAllowed
from drivebus.record.formats import format_of
from drivebus.record.sheets import read_sheet
from drivebus.record.table import ELAPSED, FIXED, seconds_of

__all__ = ["Event", "Recording", "read"]

Cells = Mapping[str, Any]
"""One row by the titles of its columns; a moment is text or a datetime."""


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened.

    Attributes:
        time: Unix time in seconds.
        drive: Whose it is; empty of what is of no drive.
        kind: `gap`, `back`, `late`, `fault`, `fault cleared`, `lost`, `moved`, `recording`, `about` or `end`.
        text: What there is to say of it.
    """

    time: float
    drive: str
    kind: str
    text: str


class Recording:
    """What stands in one or several files of a recording, in memory.

    Attributes:
        about: What is told of drives, lines, profiles and registers, as the first file has it; empty of a CSV file
            that was cut off.
        drives: The names of the drives, in their order.
        times: Unix times in seconds of the rows with values, by drive.
        states: What the drive was doing, for each of these times; empty where that is not known.
        values: By drive and title (`output_current [A]`), a value for each of these times: a number, a word, or None.
        events: What happened, in order.
        complete: Whether the last file has its end.
    """

    def __init__(self) -> None:
        self.about: Mapping[str, Any] = {}
        self.drives: list[str] = []
        self.times: dict[str, list[float]] = {}
        self.states: dict[str, list[str]] = {}
        self.values: dict[str, dict[str, list[Any]]] = {}
        self.events: list[Event] = []
        self.complete = False

    def units(self, drive: str) -> dict[str, str]:
        """The unit of each title of *drive*; empty of what has none."""
        return {title: title.rpartition(" [")[2][:-1] if title.endswith("]") else "" for title in self.values[drive]}

    def bits(self, drive: str, name: str) -> Mapping[str, Mapping[str, Any]]:
        """The fields of the register *name* of *drive*, each with its `mask` and its `labels`; empty for a number."""
        drives = [each for each in self.about.get("drives", ()) if each.get("name") == drive]
        found: Mapping[str, Any] = drives[0].get("registers", {}).get(name, {}).get("bits", {}) if drives else {}
        return found

    def take(self, titles: Iterable[str], rows: Iterable[Cells], name: str) -> None:
        """Takes the *rows* of the file called *name*, which has columns of these *titles*.

        Raises:
            NotAllowed: A row is none of a recording.
        """
        valued = [title for title in titles if title not in (*FIXED, ELAPSED)]
        self.complete = False
        for number, row in enumerate(rows, start=1):
            try:
                at = row["time"]
                when = at.timestamp() if isinstance(at, datetime) else seconds_of(at)
                drive, event = row.get("drive") or "", row.get("event") or ""
            except (KeyError, TypeError, ValueError, AttributeError):
                raise BadArgument(f"{name} is not a recording: row {number} has no time") from None
            if event:
                self._happened(Event(when, drive, event, row.get("text") or ""))
                continue
            if drive not in self.times:
                self.drives.append(drive)
                self.times[drive], self.states[drive], self.values[drive] = [], [], {}
            self.times[drive].append(when)
            self.states[drive].append(row.get("state") or "")
            self._valued(drive, valued, row)

    def _happened(self, event: Event) -> None:
        self.complete = event.kind == "end"
        self.events.append(event)
        if event.kind in ("recording", "about") and not self.about:
            # The first row of a CSV file tells it in words.
            with suppress(ValueError):
                told = json.loads(event.text)
                self.about = told if isinstance(told, dict) else {}

    def _valued(self, drive: str, titles: Iterable[str], row: Cells) -> None:
        known, count = self.values[drive], len(self.times[drive])
        for title in titles:
            value = row.get(title)
            if value is None and title not in known:
                continue
            known.setdefault(title, [None] * (count - 1)).append(value)
        for values in known.values():
            if len(values) < count:
                values.append(None)


def read(*paths: str | os.PathLike[str]) -> Recording:
    """The recording that is in *paths*: one file, or all that it was rotated through, in their order.

    Raises:
        NotAllowed: A file cannot be read, or is not a recording.
        ImportError: A Parquet file, and pyarrow is not installed.
    """
    found = Recording()
    for path in paths:
        name = os.fspath(path)
        titles, rows = _READERS[format_of(path)](Path(path), name)
        found.take(titles, rows, name)
    if not found.events and not found.drives:
        raise BadArgument(f"{', '.join(str(path) for path in paths)} has no row: it is not a recording")
    return found


_Rows = tuple[list[str], Iterator[Cells]]


def _csv_rows(path: Path, name: str) -> _Rows:
    try:
        titles, rows = read_sheet(path.read_bytes(), FIXED)
    except (OSError, NotAllowed) as error:
        raise _unread(name, error) from None
    for number, cells in rows:
        if len(cells) > len(titles):
            raise BadArgument(f"{name} is not a recording: line {number} has more cells than there are titles")
    return titles, ({title: _number(cell) for title, cell in zip(titles, cells, strict=False)} for _, cells in rows)


def _json_rows(path: Path, name: str) -> _Rows:
    try:
        lines = path.read_text(encoding="utf-8").split("\n")[:-1]
        rows = [json.loads(line) for line in lines]
    except (OSError, ValueError) as error:
        raise _unread(name, error) from None
    if not all(isinstance(row, dict) for row in rows):
        raise BadArgument(f"{name} is not a recording: a line is not an object")
    return list(dict.fromkeys(title for row in rows for title in row)), iter(rows)


def _sqlite_rows(path: Path, name: str) -> _Rows:
    if not path.is_file():
        raise BadArgument(f"{name} cannot be read: there is no such file")
    try:
        with closing(sqlite3.connect(path)) as base:
            found = base.execute("SELECT * FROM record ORDER BY rowid")
            titles = [each[0] for each in found.description]
            rows = found.fetchall()
    except sqlite3.Error as error:
        raise BadArgument(f"{name} is not a recording: {error}") from None
    return titles, (dict(zip(titles, row, strict=True)) for row in rows)


def _parquet_rows(path: Path, name: str) -> _Rows:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise NotAllowed(f"{path.suffix} files need {error.name}: pip install 'drivebus[parquet]'") from None
    try:
        table = pyarrow.parquet.read_table(path)
    except FileNotFoundError as error:
        raise _unread(name, error) from None
    except (OSError, pyarrow.ArrowException) as error:
        raise BadArgument(f"{name} is not a recording: {str(error).splitlines()[0]}") from None
    return table.column_names, iter(table.to_pylist())


_READERS = {"csv_file": _csv_rows, "json_lines": _json_rows, "sqlite": _sqlite_rows, "parquet": _parquet_rows}


def _unread(name: str, error: Exception) -> NotAllowed:
    if isinstance(error, OSError):
        return checks.unread(name, error)
    return BadArgument(f"{name} is not a recording: {error}")


def _number(cell: str) -> Any:
    """A cell of CSV: a number where it is one, None where it is empty."""
    if not cell:
        return None
    try:
        return float(cell)
    except ValueError:
        return cell
