"""Recordings as SQLite: one table, `record`."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from drivebus.record.table import FIXED, Row, Table, moment

__all__ = ["open_new"]


class _Sqlite:
    every = 0.2

    def __init__(self, path: Path, table: Table) -> None:
        self.path = path
        self._width = len(table.titles)
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        # The recorder has a thread of its own, and who closes it another.
        self._base = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        in_words = {column.title for column in table.columns if column.in_words} | {*FIXED}
        columns = ", ".join(f"{_quoted(title)} {'TEXT' if title in in_words else 'REAL'}" for title in table.titles)
        with _as_os_error():
            # Who reads meanwhile keeps nobody from writing.
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.execute("PRAGMA synchronous = NORMAL")
            self._base.execute(f"CREATE TABLE record ({columns})")

    def write(self, rows: Sequence[Row]) -> None:
        marks = ", ".join("?" * self._width)
        with _as_os_error():
            self._base.execute("BEGIN IMMEDIATE")
            try:
                self._base.executemany(f"INSERT INTO record VALUES ({marks})", [self._cells(row) for row in rows])
                self._base.execute("COMMIT")
            except sqlite3.Error:
                if self._base.in_transaction:
                    self._base.execute("ROLLBACK")
                raise

    def size(self) -> int:
        beside = self.path.with_name(f"{self.path.name}-wal")
        return self.path.stat().st_size + (beside.stat().st_size if beside.exists() else 0)

    def close(self) -> None:
        try:
            with _as_os_error():
                # One file, which can be copied by itself.
                self._base.execute("PRAGMA journal_mode = DELETE")
        finally:
            self._base.close()

    def _cells(self, row: Row) -> list[object]:
        told: list[object] = [moment(row.time), *(text or None for text in row[1 : len(FIXED)]), *row.values]
        return told + [None] * (self._width - len(told))


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


@contextmanager
def _as_os_error() -> Iterator[None]:
    """What SQLite says of a disk as what a system says of it."""
    try:
        yield
    except sqlite3.Error as error:
        code = errno.ENOSPC if "full" in str(error) else errno.EIO
        raise OSError(code, str(error)) from None


def open_new(path: Path, table: Table) -> _Sqlite:
    """A new file at *path*."""
    return _Sqlite(path, table)
