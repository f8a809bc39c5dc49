"""A damaged spool: what can still be read of it, in a file of its own."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from drivebus.spool.layout import Layout
from drivebus.spool.proof import is_proven

__all__ = ["Aside", "salvage"]

Row: TypeAlias = "tuple[Any, ...]"


class Aside(NamedTuple):
    """What became of it.

    Attributes:
        path: Where the damaged file is now.
        saved: How many samples could be read.
    """

    path: Path
    saved: int


def salvage(path: Path, schema: str) -> Aside:
    """Puts the file at *path* aside, and makes a new one there, of that *schema*, of all that can be read of it.

    What waits beside it in a log of SQLite is taken in first, as far as that is whole.

    Raises:
        OSError: There is no room, or the file cannot be moved.
    """
    aside = _free_name(path)
    path.rename(aside)
    for ending in ("-wal", "-shm"):
        beside = path.with_name(path.name + ending)
        if beside.exists():
            beside.rename(aside.with_name(aside.name + ending))
    path.touch(0o600)
    with closing(sqlite3.connect(path)) as new, closing(sqlite3.connect(aside)) as old, new:
        new.executescript(schema)
        for table in _IS_WHOLE:
            for row in filter(_IS_WHOLE[table], _readable(old, table)):
                marks = ", ".join("?" * len(row))
                new.execute(f"INSERT OR IGNORE INTO {table} VALUES ({marks})", row)
        # A sample of which nobody can tell what it has is none.
        new.execute(
            "DELETE FROM sample WHERE layout NOT IN (SELECT number FROM layout)"
            " OR epoch NOT IN (SELECT number FROM epoch)"
        )
        [(saved,)] = new.execute("SELECT count(*) FROM sample").fetchall()
    return Aside(aside, saved)


def _readable(base: sqlite3.Connection, table: str) -> Iterator[Row]:
    """The rows up to the first that cannot be read, and from the last one down to there."""
    for order in ("ASC", "DESC"):
        try:
            yield from base.execute(f"SELECT * FROM {table} ORDER BY rowid {order}")
            return
        except sqlite3.DatabaseError:
            continue


def _is_epoch(row: Row) -> bool:
    return bool(re.fullmatch(r"[0-9a-f]{16}", str(row[1])))


def _is_layout(row: Row) -> bool:
    try:
        return Layout.of_text(row[1]).text() == str(row[1])
    except (TypeError, ValueError):
        return False


def _is_position(row: Row) -> bool:
    return isinstance(row[0], str) and isinstance(row[1], int)


_IS_WHOLE: dict[str, Callable[[Row], bool]] = {
    "epoch": _is_epoch,
    "layout": _is_layout,
    "sample": is_proven,
    "position": _is_position,
}


def _free_name(path: Path) -> Path:
    names = (path.with_name(f"{path.name}.damaged-{number}") for number in range(1, 1_000_000))
    return next(name for name in names if not name.exists())
