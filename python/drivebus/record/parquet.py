"""Recordings as Parquet.

A Parquet file has its table of contents at its end, so that one which is not ended cannot be read. Here the file is
written anew with each piece and takes the old one's place at once; when it has become long, a next part begins, and in
the end the parts are joined. A kill leaves parts that can be read, each by itself.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import pyarrow
import pyarrow.parquet

from drivebus.capture.standing import Standing
from drivebus.record.table import FIXED, Row, Table

__all__ = ["open_new"]

_PART = 10_000
"""Rows after which a next part begins."""


@dataclass
class _Part:
    """One part: where it is, whether it stands there once it was written, its bytes, and its rows with values."""

    path: Path
    standing: Standing | None = None
    size: int = 0
    values: int = 0

    def gone(self) -> str:
        return "" if self.standing is None else self.standing.gone()


class _Parquet:
    every = 0.5
    about_last = False

    def __init__(self, path: Path, table: Table) -> None:
        self.path = path
        in_words = {column.title for column in table.columns if column.in_words} | {*FIXED[1:]}
        fields = [(title, pyarrow.string() if title in in_words else pyarrow.float64()) for title in table.titles[1:]]
        self._schema = pyarrow.schema([("time", pyarrow.timestamp("us", tz="UTC")), *fields])
        self._begun = 1
        self._done: list[_Part] = []
        self._part = _Part(path)
        self._rows = self._schema.empty_table()
        self._put(self._part, self._rows)

    def write(self, rows: Sequence[Row]) -> None:
        if why := self._part.gone():
            raise OSError(errno.ENOENT, why)
        # In one piece: a table of thousands of pieces of a few rows takes several times the memory of its values.
        whole = pyarrow.concat_tables([self._rows, self._table(rows)]).combine_chunks()
        self._put(self._part, whole)
        self._rows = whole
        self._part.values += sum(not row.event for row in rows)
        if whole.num_rows >= _PART:
            self._done.append(self._part)
            self._rows = self._schema.empty_table()
            self._begun += 1
            self._part = _Part(self._beside(f"part-{self._begun}"))

    def size(self) -> int:
        return self._part.size + sum(part.size for part in self._done)

    def gone(self) -> str:
        return next(filter(None, (part.gone() for part in (*self._done, self._part))), "")

    def move(self, path: Path) -> int | None:
        # Of those that are done only the files have the rows; those of the newest are in memory.
        left = [part for part in self._done if not part.gone()]
        lost = sum(part.values for part in self._done if part not in left)
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        new = _Part(path, values=self._part.values)
        before, self.path = self.path, path
        try:
            self._put(new, self._rows)
        except OSError:
            self.path = before
            path.unlink(missing_ok=True)
            raise
        # The new file may have the number of the one that is gone: at the same place nothing is taken away.
        if self._part.path != path and self._part.standing is not None and not self._part.gone():
            self._part.path.unlink(missing_ok=True)
        self._done, self._part = left, new
        return lost

    def close(self) -> None:
        parts = [part.path for part in (*self._done, self._part) if part.standing is not None]
        if parts == [self.path]:
            return
        joined = self._beside("joined")
        try:
            with pyarrow.parquet.ParquetWriter(joined, self._schema) as writer:
                for part in parts:
                    writer.write_table(pyarrow.parquet.read_table(part, schema=self._schema))
            joined.replace(self.path)
        except OSError:
            joined.unlink(missing_ok=True)
            raise
        for part in parts:
            if part != self.path:
                part.unlink()

    def _beside(self, name: str) -> Path:
        return self.path.with_name(f"{self.path.stem}.{name}{self.path.suffix}")

    def _put(self, part: _Part, rows: pyarrow.Table) -> None:
        """Writes *rows* to *part*, in the place of what was there."""
        whole = self._beside("new")
        try:
            pyarrow.parquet.write_table(rows, whole)
            status = whole.stat()
            whole.replace(part.path)
        except OSError:
            whole.unlink(missing_ok=True)
            raise
        part.standing, part.size = Standing(part.path, status), status.st_size

    def _table(self, rows: Sequence[Row]) -> pyarrow.Table:
        width = len(self._schema) - len(FIXED)
        times = [datetime.fromtimestamp(row.time, timezone.utc) for row in rows]
        texts = [[row[place] or None for row in rows] for place in range(1, len(FIXED))]
        values = [[row.values[place] if row.values else None for row in rows] for place in range(width)]
        columns = [times, *texts, *values]
        arrays = [pyarrow.array(column, field.type) for column, field in zip(columns, self._schema, strict=True)]
        return pyarrow.Table.from_arrays(arrays, schema=self._schema)


def open_new(path: Path, table: Table) -> _Parquet:
    """A new file at *path*."""
    return _Parquet(path, table)
