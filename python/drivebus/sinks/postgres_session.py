"""One connection to a PostgreSQL server: what is in, and samples with what they change of it, in one transaction.

Whoever asks anew after a lost answer learns from the same rows whether that transaction counted.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psycopg
from psycopg import errors, sql

from drivebus.errors import NotAllowed
from drivebus.sinks.intervals import Change, Intervals, runs
from drivebus.sinks.postgres_link import connection_string
from drivebus.sinks.postgres_rows import clean, write, write_events
from drivebus.sinks.postgres_tables import Tables
from drivebus.spool import Spooled

__all__ = ["Session"]

_BEGIN = sql.SQL(
    "BEGIN ISOLATION LEVEL READ COMMITTED; SET LOCAL statement_timeout = '30s'; SET LOCAL lock_timeout = '10s';"
    " SET LOCAL idle_in_transaction_session_timeout = '30s'"
)
"""Set each time: a pooler between this and the server may give each transaction another connection."""
_SILENCE = 45.0
"""Seconds for all of one transaction. A server that hangs does not watch its own time-outs."""
_ENCODINGS = ("UTF8", "SQL_ASCII")


class Session:
    """The connections of one sink, one after the other.

    Args:
        conninfo: Where the server is; see `postgres_link`.
        gateway: Whose samples these are.
        schema: Where the tables are.
        password_file: The file with the password.
    """

    name = "PostgreSQL"

    def __init__(self, conninfo: str, gateway: str, schema: str, password_file: Path | None) -> None:
        self._conninfo = conninfo
        self._gateway = clean(gateway)
        self._schema = schema
        self._password_file = password_file
        self._connection: psycopg.Connection[Any] | None = None
        self._tables: Tables | None = None
        self._inside: dict[str, Intervals] = {}
        self._is_careful = False
        self._is_over = False
        self._is_silent = False
        self._wire: socket.socket | None = None
        self._wire_lock = threading.Lock()
        self._link()

    def open(self) -> Mapping[str, Intervals]:
        """Connects, makes what is missing, and reads which samples are in, by the names of the epochs."""
        with _in_words():
            connection = psycopg.connect(self._link(), autocommit=True, prepare_threshold=None)
            self._connection = connection
            with self._within():
                return self._read(connection)

    def put(self, samples: Sequence[Spooled]) -> None:
        """Takes *samples*, all or none."""
        connection, tables = self._connection, self._tables
        assert connection is not None
        assert tables is not None
        with _in_words(), self._within():
            try:
                self._put(connection, tables, samples)
            except errors.UniqueViolation:
                # They are in, and `reached` does not say so: somebody changed it.
                self._is_careful = True
                raise

    def check(self) -> None:
        """A server that is gone is noticed by the next samples."""

    def interrupt(self) -> None:
        """Whatever waits for the server is over, from now on. Any thread."""
        self._is_over = True
        self._cut()

    def close(self) -> None:
        """Disconnects."""
        if self._connection is not None:
            with suppress(psycopg.Error):
                self._connection.close()
        self._connection = self._tables = None
        with self._wire_lock:
            if self._wire is not None:
                self._wire.close()
            self._wire = None

    def _link(self) -> str:
        return connection_string(self._conninfo, f"drivebus {self._gateway}", self._password_file)

    def _read(self, connection: psycopg.Connection[Any]) -> Mapping[str, Intervals]:
        encoding = connection.info.parameter_status("server_encoding")
        if encoding not in _ENCODINGS:
            raise NotAllowed(f"the database keeps text as {encoding}, which has not every character: make it with UTF8")
        tables = Tables(connection, self._schema, _BEGIN)
        tables.prepare()
        found = connection.execute(
            sql.SQL("SELECT epoch, first, last FROM {} WHERE gateway = %s").format(tables.reached), (self._gateway,)
        )
        told: dict[str, list[tuple[int, int]]] = {}
        for epoch, first, last in found.fetchall():
            told.setdefault(epoch, []).append((first, last))
        self._tables = tables
        self._inside = {epoch: Intervals(each) for epoch, each in told.items()}
        return self._inside

    def _put(self, connection: psycopg.Connection[Any], tables: Tables, samples: Sequence[Spooled]) -> None:
        events = [each for each in samples if each.layout.event]
        groups = _groups([each for each in samples if not each.layout.event])
        tables.take_in({id(some[0].layout): some[0].layout for some in groups.values()}.values())
        connection.execute(_BEGIN)
        for epoch, first, last in runs(samples):
            change = self._inside.setdefault(epoch, Intervals()).add(first, last)
            self._write_down(connection, tables.reached, epoch, change)
        for (family, names), group in groups.items():
            into = sql.SQL(" ({})").format(tables.columns(names))
            self._copy(connection, tables.of_family(family), into, group, write)
        if events:
            self._copy(connection, tables.event, sql.SQL(""), events, write_events)
        connection.execute("COMMIT")

    def _copy(
        self,
        connection: psycopg.Connection[Any],
        table: sql.Identifier,
        columns: sql.Composable,
        samples: Sequence[Spooled],
        write_them: Callable[[psycopg.Copy, str, Sequence[Spooled]], None],
    ) -> None:
        """Copies *samples* into the *columns* of *table*; none that it has."""
        rest = self._without_known(connection, table, samples) if self._is_careful else samples
        if rest:
            statement = sql.SQL("COPY {}{} FROM STDIN (FORMAT BINARY)").format(table, columns)
            with connection.cursor() as cursor, cursor.copy(statement) as copy:
                write_them(copy, self._gateway, rest)

    def _write_down(
        self, connection: psycopg.Connection[Any], reached: sql.Identifier, epoch: str, change: Change
    ) -> None:
        """Writes *change* down, where all is still as it was read."""
        of_epoch = (self._gateway, epoch)
        if not change.gone:
            connection.execute(
                sql.SQL("INSERT INTO {} VALUES (%s, %s, %s, %s)").format(reached), (*of_epoch, *change.come)
            )
            return
        kept, *others = change.gone
        touched = 0
        for each in others:
            touched += connection.execute(
                sql.SQL("DELETE FROM {} WHERE gateway = %s AND epoch = %s AND first = %s AND last = %s").format(
                    reached
                ),
                (*of_epoch, *each),
            ).rowcount
        touched += connection.execute(
            sql.SQL(
                "UPDATE {} SET first = %s, last = %s WHERE gateway = %s AND epoch = %s AND first = %s AND last = %s"
            ).format(reached),
            (*change.come, *of_epoch, *kept),
        ).rowcount
        if touched != len(change.gone):
            raise NotAllowed(f'somebody else writes as the gateway "{self._gateway}", too')

    def _without_known(
        self, connection: psycopg.Connection[Any], table: sql.Identifier, samples: Sequence[Spooled]
    ) -> list[Spooled]:
        """Those of *samples* that the table does not have."""
        found = connection.execute(
            sql.SQL("SELECT epoch, seq FROM {} WHERE gateway = %s AND epoch = ANY(%s) AND seq = ANY(%s)").format(table),
            (self._gateway, sorted({each.epoch for each in samples}), [each.seq for each in samples]),
        )
        known = {(epoch, seq) for epoch, seq in found.fetchall()}
        return [each for each in samples if (each.epoch, each.seq) not in known]

    @contextmanager
    def _within(self) -> Iterator[None]:
        """Breaks the connection off where the server has not answered all within a time."""
        assert self._connection is not None
        with self._wire_lock:
            if self._wire is None:
                # One of our own: the number of libpq's may belong to somebody else by the time it is broken off.
                self._wire = socket.fromfd(self._connection.fileno(), socket.AF_INET, socket.SOCK_STREAM)
        if self._is_over:
            self._cut()
        self._is_silent = False
        watch = threading.Timer(_SILENCE, self._end_silence)
        watch.daemon = True
        watch.start()
        try:
            yield
        except psycopg.Error:
            if self._is_silent:
                raise NotAllowed(f"the server did not answer for {_SILENCE:g} s") from None
            raise
        finally:
            watch.cancel()

    def _end_silence(self) -> None:
        self._is_silent = True
        self._cut()

    def _cut(self) -> None:
        with self._wire_lock, suppress(OSError):
            if self._wire is not None:
                self._wire.shutdown(socket.SHUT_RDWR)


@contextmanager
def _in_words() -> Iterator[None]:
    """What PostgreSQL says, in the same words each time."""
    try:
        yield
    except errors.DiskFull:
        raise NotAllowed("its disk is full") from None
    except errors.LockNotAvailable:
        raise NotAllowed("somebody has locked a table for more than 10 s") from None
    except psycopg.Error as error:
        told = [error.diag.message_primary or str(error), error.diag.message_hint or ""]
        lines = (line.strip().rstrip(".") for part in told for line in part.splitlines())
        raise NotAllowed("; ".join(filter(None, lines))) from None


def _groups(samples: Sequence[Spooled]) -> dict[tuple[str, tuple[str, ...]], list[Spooled]]:
    """*samples* by the columns that they fill."""
    # A reader gives the same layout each time; to compare them by what they have would take longer than all the rest.
    by_layout: dict[int, list[Spooled]] = {}
    for sample in samples:
        by_layout.setdefault(id(sample.layout), []).append(sample)
    groups: dict[tuple[str, tuple[str, ...]], list[Spooled]] = {}
    for some in by_layout.values():
        layout = some[0].layout
        groups.setdefault((layout.family, layout.names), []).extend(some)
    return groups
