"""Recordings as CSV: a line of titles, then a line for each row, times in ISO 8601 and in seconds since the beginning.

A spreadsheet takes the moments for text, and draws over the seconds.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from drivebus.record.append_file import Appended
from drivebus.record.table import ELAPSED, FIXED, Row, Table

__all__ = ["open_new"]


class _Csv(Appended):
    every = 0.2
    about_last = True

    def __init__(self, path: Path, table: Table) -> None:
        super().__init__(path)
        self._table = table
        self._append([_with(table.titles, ELAPSED)])

    def write(self, rows: Sequence[Row]) -> None:
        self._append(_with(self._table.text(row), f"{row.time - self._table.began:.3f}") for row in rows)

    def _append(self, lines: Iterable[Sequence[str]]) -> None:
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(lines)
        self.append(text.getvalue())


def _with(cells: Sequence[str], elapsed: str) -> list[str]:
    return [*cells[: len(FIXED)], elapsed, *cells[len(FIXED) :]]


def open_new(path: Path, table: Table) -> _Csv:
    """A new file at *path*."""
    return _Csv(path, table)
