"""Recordings as Parquet.

A Parquet file has its table of contents at its end, so that one which is not ended cannot be read. Here the file is
written anew with each piece and takes the old one's place at once; when it has become long, a next part begins, and in
the end the parts are joined. A kill leaves parts that can be read, each by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

import pyarrow
import pyarrow.parquet

from drivebus.record.table import FIXED, Row, Table

__all__ = ["open_new"]

_PART = 10_000
"""Rows after which a next part begins."""


class _Parquet:
    every = 0.5

    def __init__(self, path: Path, table: Table) -> None:
        self.path = path
        in_words = {column.title for column in table.columns if column.in_words} | {*FIXED[1:]}
        fields = [(title, pyarrow.string() if title in in_words else pyarrow.float64()) for title in table.titles[1:]]
        self._schema = pyarrow.schema([("time", pyarrow.timestamp("us", tz="UTC")), *fields])
        self._parts = [path]
        self._rows = self._schema.empty_table()
        self._done = 0
        self._put(path, self._rows)

    def write(self, rows: Sequence[Row]) -> None:
        # In one piece: a table of thousands of pieces of a few rows takes several times the memory of its values.
        whole = pyarrow.concat_tables([self._rows, self._table(rows)]).combine_chunks()
        self._put(self._parts[-1], whole)
        self._rows = whole
        if whole.num_rows >= _PART:
            self._done += self._parts[-1].stat().st_size
            self._rows = self._schema.empty_table()
            self._parts.append(self._beside(f"part-{len(self._parts) + 1}"))

    def size(self) -> int:
        return self._done + (self._parts[-1].stat().st_size if self._parts[-1].exists() else 0)

    def close(self) -> None:
        parts = [part for part in self._parts if part.exists()]
        if len(parts) == 1:
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
        for part in parts[1:]:
            part.unlink()

    def _beside(self, name: str) -> Path:
        return self.path.with_name(f"{self.path.stem}.{name}{self.path.suffix}")

    def _put(self, path: Path, rows: pyarrow.Table) -> None:
        """Writes *rows* to *path*, in the place of what was there."""
        whole = self._beside("new")
        try:
            pyarrow.parquet.write_table(rows, whole)
            whole.replace(path)
        except OSError:
            whole.unlink(missing_ok=True)
            raise

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
