"""A PostgreSQL server that is away, hangs or refuses: said once, tried again, and no secret said."""

from __future__ import annotations

import shutil
import socket
import sqlite3
import tempfile
import threading
from collections.abc import Iterator
from contextlib import closing
from itertools import count
from pathlib import Path
from typing import NoReturn

import pytest

from drivebus.sinks import Postgres, PostgresSettings, delivery, postgres_session
from drivebus.sinks.postgres_link import connection_string
from drivebus.spool import Reader, Spool

from .delivering import SIZE, Rows, delivered, delivering, equal, feed, held, is_in, quiet
from .postgres_server import SECRET, Server, Way, server, until

_NUMBERS = count(1)


@pytest.fixture(scope="module")
def postgres() -> Iterator[Server]:
    with server() as made:
        yield made


@pytest.fixture
def schema() -> str:
    """One for each test."""
    return f"plant_{next(_NUMBERS)}"


@pytest.fixture
def spool(quick_folder: Path) -> Iterator[Spool]:
    with Spool(quick_folder / "spool", SIZE, quiet) as spool:
        yield spool


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder whose name is short enough for a socket in it."""
    folder = Path(tempfile.mkdtemp(prefix="drivebus-way-"))
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def way(postgres: Server, folder: Path) -> Iterator[Way]:
    with closing(Way(folder, postgres.folder)) as made:
        yield made


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture(autouse=True)
def _soon_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "_FIRST_PAUSE", 0.01)
    monkeypatch.setattr(delivery, "_LONGEST_PAUSE", 0.05)
    monkeypatch.setattr(delivery, "_LOOKS", 0.02)


def attempts(monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """Grows with each connection that is tried."""
    made: list[None] = []

    def counted(given: str, application: str, password_file: Path | None) -> str:
        made.append(None)
        return connection_string(given, application, password_file)

    monkeypatch.setattr(postgres_session, "connection_string", counted)
    return made


def is_delivering() -> bool:
    return any(thread.name == "drivebus postgres" for thread in threading.enumerate())


def test_a_server_that_is_away_is_told_once_and_tried_again(
    spool: Spool, postgres: Server, folder: Path, schema: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = attempts(monkeypatch)
    feed(spool, 30)
    with Postgres(
        spool, PostgresSettings(f"host={folder} user=owner dbname=postgres", "gateway 1", schema), told.append
    ) as sink:
        until(lambda: len(tried) > 5)
        assert sink.status() == {"connected": False, "why": sink.status()["why"], "behind": 30, "delivered": 0}
        assert "No such file or directory" in sink.status()["why"]
        assert len(told) == 1
        assert told[0].startswith("no samples reach PostgreSQL: connection ")
        with closing(Way(folder, postgres.folder)):
            until(lambda: is_in(sink))
    assert told[1:] == ["samples reach PostgreSQL again"]
    assert sink.status() == {"connected": True, "why": "", "behind": 0, "delivered": 30}
    equal(spool, postgres, schema)


def test_a_server_that_hangs_keeps_nobody(spool: Spool, postgres: Server, way: Way, schema: str) -> None:
    with delivering(spool, way, schema):
        feed(spool, 10)
    sink = Postgres(spool, PostgresSettings(way.conninfo, "gateway 1", schema), quiet)
    sink.start()
    until(lambda: is_in(sink))
    way.is_silent = True
    feed(spool, 10)
    until(lambda: way.swallowed)
    sink.close()
    sink.close()
    assert not is_delivering()
    way.is_silent = False
    with delivering(spool, way, schema):
        pass
    equal(spool, postgres, schema)


def test_a_server_that_hangs_is_left_and_tried_again(
    spool: Spool, postgres: Server, way: Way, schema: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with delivering(spool, way, schema, told.append) as sink:
        feed(spool, 10)
        until(lambda: is_in(sink))
        monkeypatch.setattr(postgres_session, "_SILENCE", 0.1)
        way.is_silent = True
        feed(spool, 10)
        until(lambda: told)
        monkeypatch.undo()
        way.is_silent = False
    assert told[0].startswith("no samples reach PostgreSQL: the server did not answer for 0.1 s. They wait, and")
    equal(spool, postgres, schema)


def test_who_hangs_before_anything_is_said_keeps_nobody(spool: Spool, folder: Path, schema: str) -> None:
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(folder / ".s.PGSQL.5432"))
        listening.listen()
        sink = Postgres(spool, PostgresSettings(f"host={folder} connect_timeout=2", "gateway 1", schema), quiet)
        sink.start()
        client, _ = listening.accept()
        with client:
            sink.close()
        until(lambda: not is_delivering())


@pytest.mark.parametrize(
    ("ruin", "says"),
    [
        ("ALTER TABLE {}.gd350 RENAME TO gd350_of_old", "does not exist"),
        ("DROP TABLE {}.gd350 CASCADE", "does not exist"),
        ("ALTER TABLE {}.gd350 RENAME COLUMN output_current TO current", "output_current"),
    ],
)
def test_a_table_that_somebody_changed(
    spool: Spool, postgres: Server, schema: str, told: list[str], ruin: str, says: str
) -> None:
    with delivering(spool, postgres, schema, told.append) as sink:
        feed(spool, 10)
        until(lambda: is_in(sink))
        postgres.ask(ruin.format(schema))
        feed(spool, 10)
    assert says in told[0]
    assert told[1:] == ["samples reach PostgreSQL again"]
    rows = delivered(postgres, schema)
    assert {seq for _, seq in rows} >= set(range(11, 21))


def test_who_lost_what_is_in_doubles_nothing(spool: Spool, postgres: Server, schema: str, told: list[str]) -> None:
    with delivering(spool, postgres, schema):
        feed(spool, 30)
    postgres.ask(f"DROP TABLE {schema}.reached")
    postgres.ask(f"DELETE FROM {schema}.gd350 WHERE seq = 7")
    with delivering(spool, postgres, schema, told.append):
        feed(spool, 10)
    assert "duplicate key" in told[0]
    equal(spool, postgres, schema)


def test_somebody_else_who_writes_what_is_in_is_noticed(
    spool: Spool, postgres: Server, schema: str, told: list[str]
) -> None:
    with delivering(spool, postgres, schema, told.append) as sink:
        feed(spool, 30)
        until(lambda: is_in(sink))
        postgres.ask(f"UPDATE {schema}.reached SET last = 20")
        feed(spool, 10)
    assert 'somebody else writes as the gateway "gateway 1", too' in told[0]
    equal(spool, postgres, schema)


def test_rights_that_are_given_later(spool: Spool, postgres: Server, schema: str, told: list[str]) -> None:
    postgres.ask(f"CREATE ROLE {schema} LOGIN")
    settings = PostgresSettings(postgres.conninfo.replace("owner", schema), "gateway 1", schema)
    with Postgres(spool, settings, told.append) as sink:
        feed(spool, 10)
        until(lambda: told)
        assert "permission denied" in sink.status()["why"]
        with delivering(spool, postgres, schema):
            pass
        until(lambda: any("denied for schema" in each for each in told))
        postgres.ask(f"GRANT USAGE ON SCHEMA {schema} TO {schema}")
        postgres.ask(f"GRANT SELECT, INSERT, UPDATE, DELETE ON ALL TABLES IN SCHEMA {schema} TO {schema}")
        feed(spool, 10)
        until(lambda: is_in(sink))
    assert len(told) == len(set(told))
    equal(spool, postgres, schema)


def test_a_full_disk_is_told_once(
    spool: Spool, postgres: Server, schema: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with delivering(spool, postgres, schema):
        feed(spool, 10)
    # A different block each time.
    postgres.ask(
        f"CREATE FUNCTION {schema}.full() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN RAISE EXCEPTION"
        " 'could not extend file at block %', random() USING ERRCODE = '53100'; END $$"
    )
    postgres.ask(f"CREATE TRIGGER full_disk BEFORE INSERT ON {schema}.gd350 EXECUTE FUNCTION {schema}.full()")
    tried = attempts(monkeypatch)
    with delivering(spool, postgres, schema, told.append):
        feed(spool, 10)
        until(lambda: len(tried) > 5)
        postgres.ask(f"DROP TRIGGER full_disk ON {schema}.gd350")
    assert [each.split(". ")[0] for each in told] == [
        "no samples reach PostgreSQL: its disk is full",
        "samples reach PostgreSQL again",
    ]
    equal(spool, postgres, schema)


def test_a_spool_that_cannot_be_read_is_named(
    spool: Spool, postgres: Server, schema: str, told: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(*_: object) -> NoReturn:
        raise sqlite3.DatabaseError("database disk image is malformed")

    with monkeypatch.context() as patch:
        patch.setattr(Reader, "after", damaged)
        with Postgres(spool, PostgresSettings(postgres.conninfo, "gateway 1", schema), told.append):
            until(lambda: told)
    assert told[0].startswith(
        "no samples reach PostgreSQL: the spool cannot be read: database disk image is malformed."
    )


def test_a_table_of_somebody_else_is_left_alone(spool: Spool, postgres: Server, schema: str, told: list[str]) -> None:
    postgres.ask(f"CREATE SCHEMA {schema}")
    postgres.ask(f"CREATE TABLE {schema}.gd350 (price int)")
    with delivering(spool, postgres, schema, told.append):
        feed(spool, 10)
        until(lambda: told)
        assert f'the table "gd350" in the schema "{schema}" is something else: rename it' in told[0]
        assert postgres.ask(f"SELECT * FROM {schema}.gd350") == []
        postgres.ask(f"ALTER TABLE {schema}.gd350 RENAME TO prices")
    equal(spool, postgres, schema)


def test_two_that_deliver_as_the_same_gateway_double_nothing(spool: Spool, postgres: Server, schema: str) -> None:
    with delivering(spool, postgres, schema), delivering(spool, postgres, schema):
        for _ in range(30):
            feed(spool, 20)
    equal(spool, postgres, schema)


def test_gateways_that_make_the_same_tables_at_once(quick_folder: Path, postgres: Server, schema: str) -> None:
    spools = [Spool(quick_folder / f"spool {number}", SIZE, quiet) for number in range(4)]
    settings = [PostgresSettings(postgres.conninfo, f"gateway {number}", schema) for number in range(4)]
    sinks = [Postgres(*each, quiet) for each in zip(spools, settings, strict=True)]
    expected: Rows = {}
    for spool, sink in zip(spools, sinks, strict=True):
        feed(spool, 25)
        sink.start()
    until(lambda: all(map(is_in, sinks)))
    for spool, sink in zip(spools, sinks, strict=True):
        sink.close()
        with closing(spool.reader("test")) as reader:
            expected |= held(reader)
        spool.close()
    assert delivered(postgres, schema) == expected


def test_a_database_that_has_not_every_character(spool: Spool, postgres: Server, schema: str, told: list[str]) -> None:
    postgres.ask("CREATE DATABASE latin ENCODING 'LATIN1' LC_COLLATE 'C' LC_CTYPE 'C' TEMPLATE template0")
    conninfo = postgres.conninfo.replace("dbname=postgres", "dbname=latin")
    with Postgres(spool, PostgresSettings(conninfo, "gateway 1", schema), told.append):
        until(lambda: told)
    assert "the database keeps text as LATIN1, which has not every character" in told[0]


def test_a_password_comes_from_a_file_and_is_never_said(
    spool: Spool, postgres: Server, schema: str, told: list[str], quick_folder: Path
) -> None:
    postgres.ask(f"GRANT CREATE ON DATABASE postgres TO {SECRET}")
    conninfo = postgres.conninfo.replace("owner", SECRET)
    file = quick_folder / "password"
    file.write_text("not this\n")
    file.chmod(0o600)
    settings = PostgresSettings(conninfo, "gateway 1", schema, file)
    with Postgres(spool, settings, told.append) as sink:
        until(lambda: told)
        file.write_text("the right one\n")
        feed(spool, 10)
        until(lambda: is_in(sink))
    assert "password authentication failed" in told[0]
    assert "not this" not in "".join([*told, repr(settings)])
    equal(spool, postgres, schema)
