"""Recordings as JSON lines: an object for each row, without what the row does not have."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from drivebus.record.append_file import Appended
from drivebus.record.table import FIXED, Row, Table, moment

__all__ = ["open_new"]


class _JsonLines(Appended):
    every = 0.2
    about_last = False

    def __init__(self, path: Path, table: Table) -> None:
        super().__init__(path)
        self._titles = table.titles[len(FIXED) :]

    def write(self, rows: Sequence[Row]) -> None:
        self.append("".join(f"{json.dumps(self._object(row), ensure_ascii=False)}\n" for row in rows))

    def _object(self, row: Row) -> dict[str, Any]:
        told: dict[str, Any] = {"time": moment(row.time)}
        told |= {name: text for name, text in zip(FIXED[1:], row[1 : len(FIXED)], strict=True) if text}
        values = zip(self._titles, row.values, strict=False)
        return told | {title: value for title, value in values if value is not None}


def open_new(path: Path, table: Table) -> _JsonLines:
    """A new file at *path*."""
    return _JsonLines(path, table)
