"""The file in which samples wait: SQLite, committed once a second, so that a sample which was read from it is kept.

Every sample has a number, `seq`, which only rises, and belongs to an epoch: the time for which one program has had the
file open. The epoch has a name that no other has. Where a disk has lost the end of the file, numbers are given again,
and the names tell them apart. Whoever reads has a position of its own, and one that is slow keeps nobody else.
"""

from __future__ import annotations

import secrets
import sqlite3
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from drivebus.errors import NotAllowed
from drivebus.spool.layout import Layout
from drivebus.spool.owner import owned
from drivebus.spool.proof import is_proven, proof_of
from drivebus.spool.salvage import salvage
from drivebus.values import Value

__all__ = ["Reader", "Spool", "Spooled", "Stretch"]

_SCHEMA = """
CREATE TABLE IF NOT EXISTS epoch (number INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS layout (number INTEGER PRIMARY KEY, told TEXT NOT NULL UNIQUE);
CREATE TABLE IF NOT EXISTS sample (seq INTEGER PRIMARY KEY AUTOINCREMENT, epoch INTEGER NOT NULL,
    layout INTEGER NOT NULL, time REAL NOT NULL, took REAL NOT NULL, missing TEXT NOT NULL,
    packed BLOB NOT NULL, proof INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS position (sink TEXT PRIMARY KEY, seq INTEGER NOT NULL);
"""
_COMMITS = 1.0
"""Seconds between two commits: so much is lost if the computer loses its power."""
_IN_MEMORY = 100_000
"""Samples that wait in memory where the disk takes none."""
_AT_A_TIME = 20
"""Of so many parts of a full file, the oldest goes."""
_PATIENCE = 10.0
"""Seconds that a commit waits for another program that looks into the file."""
_DAMAGED = Layout.of_events("", "damaged")
"""What a damaged sample is."""
_NO_NUMBER = 1 << 62
"""No sample has such a number."""


class Spooled(NamedTuple):
    """One sample, or one event, as it is read from the file.

    Attributes:
        seq: Its number. Within the file it only rises.
        epoch: The name of the time in which it was kept.
        layout: What it has.
        time: Unix time in seconds at which its first request left.
        took: Seconds until its last answer was complete, or was given up.
        missing: Why there are no values, in words; empty where there are. Of an event: what happened.
        values: One for each name of the layout.
    """

    seq: int
    epoch: str
    layout: Layout
    time: float
    took: float
    missing: str
    values: tuple[Value, ...]


class Stretch(NamedTuple):
    """What the file has of one epoch.

    Attributes:
        epoch: Its name.
        first: The number of its first sample.
        last: The number of its last one.
    """

    epoch: str
    first: int
    last: int


class _New(NamedTuple):
    """A sample that is not in the file yet."""

    layout: Layout
    time: float
    took: float
    missing: str
    packed: bytes


class Spool:
    """A file of samples, until it is closed.

    Args:
        path: The file. A new one is made 0600.
        size: Bytes that it may have. The oldest samples give way, whether they were read or not; that is counted.
        tell: Hears in words what people should know.

    Raises:
        NotAllowed: It is no such file, or another program has it.
        OSError: The system does not let it be opened.
    """

    def __init__(self, path: Path, size: int, tell: Callable[[str], None]) -> None:
        self.path = path
        self.size = size
        self._tell = tell
        self._lock = threading.Lock()
        self._came = threading.Condition(self._lock)
        self._committing = threading.Lock()
        self._new: list[_New] = []
        self._reached: dict[str, int] = {}
        self._layouts: dict[Layout, int] = {}
        self._added = 0
        self._lost = 0
        self._why = ""
        self._closing = threading.Event()
        self._owned = owned(path)
        try:
            self._base = _opened(path, tell)
        except BaseException:
            self._owned.close()
            raise
        [(self._epoch,)] = self._base.execute(
            "INSERT INTO epoch (name) VALUES (?) RETURNING number", (secrets.token_hex(8),)
        ).fetchall()
        self._last = int(self._base.execute("SELECT coalesce(max(seq), 0) FROM sample").fetchone()[0])
        # A file that lost its end gives numbers again, and nobody has what comes under them.
        self._base.execute("UPDATE position SET seq = min(seq, ?)", (self._last,))
        self._thread = threading.Thread(target=self._commit_always, name="drivebus spool", daemon=True)
        self._thread.start()

    def add(self, layout: Layout, at: float, took: float, missing: str, values: Sequence[Value]) -> None:
        """Keeps a sample, from the next commit on. Any thread."""
        new = _New(layout, at, took, missing, b"" if missing else layout.packed(values))
        with self._lock:
            self._new.append(new)
            self._added += 1
            self._give_way()

    def note(self, subject: str, kind: str, at: float, text: str) -> None:
        """Keeps an event, in its place among the samples: what happened to *subject*, in words. Any thread."""
        self.add(Layout.of_events(subject, kind), at, 0.0, text, ())

    def reached(self, sink: str, seq: int) -> None:
        """Whoever is called *sink* has all up to *seq*; that is kept with the next commit. Any thread."""
        with self._lock:
            self._reached[sink] = seq

    def reader(self, sink: str) -> Reader:
        """Reads for whoever is called *sink*, in the thread that calls this."""
        return Reader(self, sink)

    @property
    def last(self) -> int:
        """The number of the last sample that is in the file; 0: none is."""
        return self._last

    @property
    def added(self) -> int:
        """How many samples were added since this was opened."""
        return self._added

    @property
    def lost(self) -> int:
        """How many samples gave way since this was opened, because the file or the disk was full."""
        return self._lost

    def wait(self, after: int, timeout: float) -> bool:
        """Waits for a sample behind number *after*, for *timeout* seconds at most; whether there is one.

        When this is closed, nobody waits any longer.
        """
        with self._came:
            self._came.wait_for(lambda: self._last > after or self._closing.is_set(), timeout)
            return self._last > after

    def commit(self) -> None:
        """Writes down what is to be kept. Once a second it happens by itself."""
        with self._committing:
            with self._lock:
                new, self._new = self._new, []
                reached, self._reached = self._reached, {}
            if not (new or reached):
                return
            try:
                last = self._write(new, reached)
            except sqlite3.Error as error:
                with self._lock:
                    self._new = new + self._new
                    self._reached = reached | self._reached
                    self._give_way()
                self._complain(str(error))
                return
            with self._came:
                self._last = last
                self._came.notify_all()
            # Those samples are in the file. Whatever comes of the old ones, they must not be written again.
            try:
                self._make_room()
            except sqlite3.Error as error:
                self._complain(str(error))
            else:
                self._complain("")

    def _give_way(self) -> None:
        """The oldest of those that the disk does not take, beyond as many as are kept in memory."""
        beyond = len(self._new) - _IN_MEMORY
        if beyond > 0:
            self._lost += beyond
            del self._new[:beyond]

    def _complain(self, why: str) -> None:
        if why and why != self._why:
            self._tell(f"the spool {self.path} takes nothing: {why}. What comes is kept in memory meanwhile")
        elif self._why and not why:
            self._tell(f"the spool {self.path} takes samples again")
        self._why = why

    def _commit_always(self) -> None:
        while not self._closing.wait(_COMMITS):
            self.commit()

    def _write(self, new: Sequence[_New], reached: Mapping[str, int]) -> int:
        """Writes down *new* and who has *reached* what, all or nothing; the number of the last sample."""
        base = self._base
        with base:
            base.execute("BEGIN IMMEDIATE")
            rows = [(self._epoch, self._layout(each.layout), *each[1:]) for each in new]
            base.executemany(
                "INSERT INTO sample (epoch, layout, time, took, missing, packed, proof) VALUES (?, ?, ?, ?, ?, ?, ?)",
                [(*row, proof_of(*row)) for row in rows],
            )
            base.executemany("INSERT OR REPLACE INTO position VALUES (?, ?)", reached.items())
            [(last,)] = base.execute("SELECT seq FROM sqlite_sequence WHERE name = 'sample'").fetchall() or [(0,)]
        return int(last)

    def _layout(self, layout: Layout) -> int:
        if layout not in self._layouts:
            told = layout.text()
            self._base.execute("INSERT OR IGNORE INTO layout (told) VALUES (?)", (told,))
            [(number,)] = self._base.execute("SELECT number FROM layout WHERE told = ?", (told,)).fetchall()
            self._layouts[layout] = number
        return self._layouts[layout]

    def _make_room(self) -> None:
        """Where the file is full, a part of the oldest samples goes."""
        if _bytes_used(self._base) <= self.size:
            return
        with self._base as base:
            [(first, last)] = base.execute("SELECT min(seq), max(seq) FROM sample").fetchall()
            gone = base.execute("DELETE FROM sample WHERE seq <= ?", (first + (last - first) // _AT_A_TIME,)).rowcount
        with self._lock:
            self._lost += gone
        self._tell(f"the spool {self.path} is full: its oldest {gone} samples are gone")

    def close(self) -> None:
        """Commits, and closes the file. Closing again does nothing."""
        if self._closing.is_set():
            return
        self._closing.set()
        with self._came:
            self._came.notify_all()
        self._thread.join()
        self.commit()
        self._base.close()
        self._owned.close()

    def __enter__(self) -> Spool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Reader:
    """One who reads samples, at a pace of its own. For one thread.

    Args:
        spool: What is read.
        sink: Who reads; the position is kept under this name.
    """

    def __init__(self, spool: Spool, sink: str) -> None:
        self._spool = spool
        self._sink = sink
        self._base = _connected(spool.path)
        self._layouts: dict[int, Layout] = {}
        self._epochs: dict[int, str] = {}

    def position(self) -> int:
        """The number of the last sample that this one has, as it was kept; 0: none."""
        found = self._base.execute("SELECT seq FROM position WHERE sink = ?", (self._sink,)).fetchone()
        return 0 if found is None else int(found[0])

    def after(self, seq: int, limit: int, before: int | None = None) -> list[Spooled]:
        """The first samples behind number *seq*, *limit* at most; and with numbers below *before*."""
        rows = self._base.execute(
            "SELECT seq, epoch, layout, time, took, missing, packed, proof FROM sample WHERE seq > ? AND seq < ?"
            " ORDER BY seq LIMIT ?",
            (seq, _NO_NUMBER if before is None else before, limit),
        )
        return [self._read(row) for row in rows.fetchall()]

    def stretches(self) -> list[Stretch]:
        """What the file has of each epoch, the oldest first."""
        # Samples of later epochs have higher numbers, so the ends are searched for, and not all samples read.
        found: list[Stretch] = []
        with self._base as base:
            base.execute("BEGIN")
            [(newest,)] = base.execute("SELECT max(seq) FROM sample").fetchall()
            here = self._at_or_behind(0)
            while here is not None:
                first, epoch = here
                last, beyond = first, newest + 1
                while beyond - last > 1:
                    middle = (last + beyond) // 2
                    there = self._at_or_behind(middle)
                    last, beyond = (middle, beyond) if there and there[1] == epoch else (last, middle)
                found.append(Stretch(self._epoch(epoch), first, last))
                here = self._at_or_behind(beyond)
        return found

    def wait(self, seq: int, timeout: float) -> bool:
        """Waits for a sample behind number *seq*, for *timeout* seconds at most; whether there is one."""
        return self._spool.wait(seq, timeout)

    def reached(self, seq: int) -> None:
        """This one has all up to *seq*."""
        self._spool.reached(self._sink, seq)

    def close(self) -> None:
        """Reads no more."""
        self._base.close()

    def _sample(
        self, seq: int, epoch: int, layout: int, at: float, took: float, missing: str, packed: bytes
    ) -> Spooled:
        if layout not in self._layouts:
            [(told,)] = self._base.execute("SELECT told FROM layout WHERE number = ?", (layout,)).fetchall()
            self._layouts[layout] = Layout.of_text(told)
        known = self._layouts[layout]
        return Spooled(seq, self._epoch(epoch), known, at, took, missing, () if missing else known.values(packed))

    def _read(self, row: tuple[Any, ...]) -> Spooled:
        with suppress(ValueError):
            if is_proven(row):
                return self._sample(*row[:-1])
        return self._damaged(*row[:2])

    def _damaged(self, seq: int, epoch: int) -> Spooled:
        """A sample that is not as it was written. Its number is kept, so that nobody waits for it."""
        return Spooled(seq, self._epoch(epoch), _DAMAGED, 0.0, 0.0, "damaged in the spool", ())

    def _epoch(self, number: int) -> str:
        if number not in self._epochs:
            found = self._base.execute("SELECT name FROM epoch WHERE number = ?", (number,)).fetchone()
            self._epochs[number] = "" if found is None else found[0]
        return self._epochs[number]

    def _at_or_behind(self, seq: int) -> tuple[int, int] | None:
        """The first sample with number *seq* or a higher one: its number, and the number of its epoch."""
        found: tuple[int, int] | None = self._base.execute(
            "SELECT seq, epoch FROM sample WHERE seq >= ? ORDER BY seq LIMIT 1", (seq,)
        ).fetchone()
        return found


def _connected(path: Path) -> sqlite3.Connection:
    # Without a transaction that nobody asked for; what is written is written by one thread at a time.
    base = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=_PATIENCE)
    base.execute("PRAGMA journal_mode = WAL")
    base.execute("PRAGMA synchronous = FULL")
    return base


def _opened(path: Path, tell: Callable[[str], None]) -> sqlite3.Connection:
    """The file, made where it is not there, and made anew from what can be read of it where it is damaged."""
    if not path.exists():
        path.touch(0o600)
    try:
        return _prepared(path)
    except sqlite3.DatabaseError as error:
        if isinstance(error, sqlite3.OperationalError) and "malformed" not in str(error):
            raise NotAllowed(f"the spool {path} cannot be opened: {error}") from None
    aside = salvage(path, _SCHEMA)
    tell(f"the spool {path} was damaged: {aside.saved} samples of it could be read, and the old file is {aside.path}")
    return _prepared(path)


def _prepared(path: Path) -> sqlite3.Connection:
    base = _connected(path)
    try:
        [(first,)] = base.execute("PRAGMA quick_check(1)").fetchall()
        if first != "ok":
            raise sqlite3.DatabaseError(first)
        base.executescript(_SCHEMA)
    except BaseException:
        base.close()
        raise
    return base


def _bytes_used(base: sqlite3.Connection) -> int:
    [(pages, free, size)] = base.execute(
        "SELECT page_count, freelist_count, page_size FROM pragma_page_count, pragma_freelist_count, pragma_page_size"
    ).fetchall()
    return int((pages - free) * size)
