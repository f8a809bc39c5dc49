"""What a file of samples has of one value of one drive, between two moments: for curves."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

from drivebus.spool.layout import Layout
from drivebus.values import Value

__all__ = ["history_of"]


def history_of(path: Path, drive: str, name: str, since: float, until: float) -> Iterator[tuple[float, Value | None]]:
    """The samples of value *name* of *drive* between the Unix times *since* and *until*, as time and value.

    None stands where the drive gave no values. They come in the order in which they were kept. It is read beside
    whoever writes, in the thread that calls this.

    Raises:
        OSError: The file cannot be read.
    """
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=1.0)) as base:
            yield from _rows(base, drive, name, since, until)
    except sqlite3.Error as error:
        raise OSError(f"{path}: {error}") from None


def _rows(
    base: sqlite3.Connection, drive: str, name: str, since: float, until: float
) -> Iterator[tuple[float, Value | None]]:
    layouts = _layouts(base, drive, name)
    if not layouts:
        return
    marks = ", ".join("?" * len(layouts))
    rows = base.execute(
        f"SELECT layout, time, missing, packed FROM sample WHERE seq >= ? AND layout IN ({marks}) ORDER BY seq",
        (_first_since(base, since), *layouts),
    )
    for number, at, missing, packed in rows:
        if not since <= at <= until:
            continue
        layout, place = layouts[number]
        value = None
        if not missing:
            with suppress(ValueError):
                value = layout.values(packed)[place]
        yield at, value


def _layouts(base: sqlite3.Connection, drive: str, name: str) -> dict[int, tuple[Layout, int]]:
    """The layouts of *drive* that have *name*, and in which place."""
    found: dict[int, tuple[Layout, int]] = {}
    for number, told in base.execute("SELECT number, told FROM layout").fetchall():
        with suppress(ValueError):
            layout = Layout.of_text(told)
            if layout.drive == drive and not layout.event and name in layout.names:
                found[number] = (layout, layout.names.index(name))
    return found


def _first_since(base: sqlite3.Connection, since: float) -> int:
    """The number of a sample before which all are older than *since*, or nearly all where a clock was set."""
    [(low, high)] = base.execute("SELECT coalesce(min(seq), 0), coalesce(max(seq), 0) FROM sample").fetchall()
    while low < high:
        middle = (low + high) // 2
        found = base.execute("SELECT seq, time FROM sample WHERE seq > ? ORDER BY seq LIMIT 1", (middle,)).fetchone()
        if found is None or found[1] >= since:
            high = middle
        else:
            low = int(found[0])
    return int(low)
