"""Recordings as SQLite: one table, `record`."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from drivebus.capture.standing import Standing
from drivebus.record.table import FIXED, Row, Table, moment

__all__ = ["open_new"]


class _Sqlite:
    every = 0.2
    about_last = False

    def __init__(self, path: Path, table: Table) -> None:
        self.path = path
        self._width = len(table.titles)
        self._base, self._standing = _made(path)
        in_words = {column.title for column in table.columns if column.in_words} | {*FIXED}
        columns = ", ".join(f"{_quoted(title)} {'TEXT' if title in in_words else 'REAL'}" for title in table.titles)
        with _as_os_error():
            _prepare(self._base)
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
        size = 0
        for path in (self.path, self.path.with_name(f"{self.path.name}-wal")):
            with suppress(OSError):
                size += path.stat().st_size
        return size

    def gone(self) -> str:
        return self._standing.gone()

    def move(self, path: Path) -> int | None:
        new, standing = _made(path)
        try:
            # The old one is open, wherever its name has gone.
            self._base.backup(new)
        except sqlite3.Error as error:
            new.close()
            path.unlink(missing_ok=True)
            if "full" in str(error):
                raise OSError(errno.ENOSPC, str(error)) from None
            return None
        # Before the new one has a log beside it: the old one's would have the same name.
        with suppress(sqlite3.Error):
            self._base.close()
        self.path, self._base, self._standing = path, new, standing
        with _as_os_error():
            _prepare(new)
        return 0

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


def _made(path: Path) -> tuple[sqlite3.Connection, Standing]:
    """A new base at *path*, which must not be there."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    standing = Standing(path, os.fstat(file))
    os.close(file)
    # The recorder has a thread of its own, and who closes it another.
    return sqlite3.connect(path, isolation_level=None, check_same_thread=False), standing


def _prepare(base: sqlite3.Connection) -> None:
    # Who reads meanwhile keeps nobody from writing.
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA synchronous = NORMAL")


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
