"""The PostgreSQL sink at a real server: each sample once, whatever ends, breaks or is cut in between."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import count
from pathlib import Path

import pytest

from drivebus.sinks import Postgres, PostgresSettings, delivery
from drivebus.sinks.postgres_session import Session
from drivebus.spool import Layout, Spool, Spooled

from .delivering import (
    LAYOUT,
    SIZE,
    Rows,
    cut_afterwards,
    delivered,
    delivering,
    equal,
    feed,
    held,
    is_in,
    quiet,
    quoted,
)
from .postgres_server import ROOT, Server, Way, server, until

CHANCE = random.Random(1)
_NUMBERS = count(1)


@pytest.fixture(scope="module")
def postgres() -> Iterator[Server]:
    with server() as made:
        yield made


@pytest.fixture
def schema() -> str:
    """One for each test."""
    return f"plant {next(_NUMBERS)}"


@pytest.fixture
def spool(quick_folder: Path) -> Iterator[Spool]:
    with Spool(quick_folder / "spool", SIZE, quiet) as spool:
        yield spool


@pytest.fixture
def way(postgres: Server) -> Iterator[Way]:
    folder = Path(tempfile.mkdtemp(prefix="drivebus-way-"))
    with closing(Way(folder, postgres.folder)) as made:
        yield made
    shutil.rmtree(folder)


@pytest.fixture(autouse=True)
def _soon_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivery, "_FIRST_PAUSE", 0.01)
    monkeypatch.setattr(delivery, "_LONGEST_PAUSE", 0.05)
    monkeypatch.setattr(delivery, "_LOOKS", 0.02)


def pause(longest: float) -> None:
    """Some time, so that what follows comes at any moment. Nothing is judged by it."""
    threading.Event().wait(CHANCE.random() * longest)


def test_each_sample_is_a_row(spool: Spool, postgres: Server, schema: str) -> None:
    told: list[str] = []
    with delivering(spool, postgres, schema, told.append) as sink:
        feed(spool, 1000)
    assert not told
    assert sink.status()["delivered"] == 1000
    equal(spool, postgres, schema)
    narrow = f"FROM {quoted(schema)}.narrow WHERE"
    assert postgres.ask(f"SELECT DISTINCT name {narrow} gateway = 'gateway 1' ORDER BY name") == [
        ("0x3000",),
        ("output_current",),
        ("set speed",),
    ]
    at = "time = to_timestamp(1.7e9 + 0.25)"
    assert postgres.ask(f"SELECT drive, name, value {narrow} {at} ORDER BY value") == [
        ("pump", "output_current", 0.1),
        ("pump", "set speed", 1.1),
        ("pump", "0x3000", 2.1),
    ]
    units = "SELECT attname, col_description(attrelid, attnum) FROM pg_attribute WHERE attrelid = %s::regclass"
    comments = dict(postgres.ask(units, f"{quoted(schema)}.gd350"))
    assert (comments["output_current"], comments["set speed"], comments["0x3000"]) == ("A", "rpm", None)


def test_who_has_all_goes_on_behind_it(spool: Spool, postgres: Server, schema: str) -> None:
    for _ in range(3):
        with delivering(spool, postgres, schema) as sink:
            feed(spool, 10)
        assert sink.status()["delivered"] == 10
    equal(spool, postgres, schema)
    spool.commit()
    with closing(spool.reader("postgres")) as reader:
        assert reader.position() == 30


def test_columns_are_added_and_each_family_has_a_table(spool: Spool, postgres: Server, schema: str) -> None:
    more = Layout("fan", "gd350", (*LAYOUT.names, "torque"), (*LAYOUT.units, "%"), (*LAYOUT.digits, 1))
    nameless = Layout("mill", "", ("0x3001",), ("",), (0,))
    with delivering(spool, postgres, schema):
        feed(spool, 20)
        until(lambda: postgres.ask("SELECT to_regclass(%s)", f"{quoted(schema)}.gd350") != [(None,)])
        feed(spool, 20, more)
        feed(spool, 20, nameless)
    assert len(delivered(postgres, schema)) == 40
    assert len(delivered(postgres, schema, nameless, "unknown")) == 20
    torque = f"SELECT DISTINCT drive FROM {quoted(schema)}.narrow WHERE name = 'torque'"
    assert postgres.ask(torque) == [("fan",)]


NAMES = (
    'Robert"); DROP TABLE x;--',
    "$(reboot)",
    "two\nlines",
    "100 %s",
    "time",
    "xmin",
    "x" * 70,
    "x" * 71,
    "ü" * 40,
    "",
)


def test_any_name_is_a_name(spool: Spool, postgres: Server) -> None:
    schema = 'my "schema"'
    layout = Layout(NAMES[0], NAMES[0] + "\n\0", NAMES, ("m³/h' --",) * len(NAMES), (1,) * len(NAMES))
    reserved = Layout("\0", "reached", ("value",), ("\\",), (0,))
    with delivering(spool, postgres, schema):
        feed(spool, 9, layout)
        feed(spool, 9, reserved)
    narrow = postgres.ask(f"SELECT drive, count(DISTINCT name) FROM {quoted(schema)}.narrow GROUP BY 1")
    assert dict(narrow) == {"\N{REPLACEMENT CHARACTER}": 1, NAMES[0]: len(NAMES)}
    columns = {name for (name,) in postgres.ask(f"SELECT DISTINCT name FROM {quoted(schema)}.narrow")}
    assert set(NAMES[:4]) < columns
    assert max(len(name.encode()) for name in columns) == 63


def test_connections_that_are_ended_at_any_moment(spool: Spool, postgres: Server, schema: str) -> None:
    end = "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name = 'drivebus gateway 1'"
    with delivering(spool, postgres, schema):
        ended = 0
        while ended < 40:
            feed(spool, 50)
            pause(0.03)
            ended += postgres.ask(end)[0][0]
    equal(spool, postgres, schema)


def test_a_server_that_is_stopped_at_once_at_any_moment(spool: Spool, postgres: Server, schema: str) -> None:
    told: list[str] = []
    with delivering(spool, postgres, schema, told.append):
        for _ in range(5):
            for _ in range(CHANCE.randrange(1, 10)):
                feed(spool, 50)
                pause(0.02)
            postgres.stop_at_once()
            feed(spool, 50)
            postgres.start()
    equal(spool, postgres, schema)
    assert told


@pytest.mark.parametrize("given", [1.0, 0.5])
def test_commits_whose_answer_is_lost(spool: Spool, postgres: Server, way: Way, schema: str, given: float) -> None:
    told: list[str] = []
    way.cut = lambda: CHANCE.random() < given
    with delivering(spool, way, schema, told.append):
        while way.broken < 25:
            feed(spool, 20)
            pause(0.01)
        way.cut = None
    equal(spool, postgres, schema)
    # What had counted was not even tried again.
    assert given < 1.0 or not any("duplicate" in each for each in told)


def test_a_program_that_is_killed_at_any_moment(quick_folder: Path, postgres: Server, schema: str) -> None:
    path = quick_folder / "spool"
    command = [sys.executable, "-m", "tests.python.delivering", postgres.conninfo, schema, str(path)]
    with subprocess.Popen(
        command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**os.environ}
    ) as program:
        assert program.stdin is not None
        assert program.stdout is not None
        for _ in range(20):
            program.stdin.write("\n")
            program.stdin.flush()
            lines = [program.stdout.readline() for _ in range(CHANCE.randrange(2, 12))]
            pause(0.03)
            [number] = [line for line in lines if line.strip().isdigit()]
            os.kill(int(number), signal.SIGKILL)
            while program.stdout.readline() != "ended\n":
                pass
        program.stdin.close()
    with Spool(path, SIZE, quiet) as spool, closing(spool.reader("test")) as reader:
        with Postgres(spool, PostgresSettings(postgres.conninfo, "killed", schema), quiet) as sink:
            until(lambda: is_in(sink))
        rows = held(reader)
        assert len({epoch for epoch, _ in rows}) > 10
        assert delivered(postgres, schema) == rows


def test_a_spool_that_is_cut_anywhere(quick_folder: Path, postgres: Server, schema: str) -> None:
    path = quick_folder / "spool"
    everything: Rows = {}
    for _ in range(100):
        spool = Spool(path, SIZE, quiet)
        feed(spool, 10)
        with delivering(spool, postgres, schema), closing(spool.reader("test")) as reader:
            everything |= held(reader)
        # These are not delivered, and may be there when it was cut.
        feed(spool, 10)
        with cut_afterwards(path, CHANCE):
            spool.close()
    assert delivered(postgres, schema) == everything
    assert len({epoch for epoch, _ in everything}) == 100


def test_what_gave_way_is_not_waited_for(quick_folder: Path, postgres: Server, schema: str) -> None:
    with Spool(quick_folder / "spool", 200_000, quiet) as spool, closing(spool.reader("test")) as reader:
        with delivering(spool, postgres, schema):
            feed(spool, 100)
        while spool.lost < 500:
            feed(spool, 500)
        with delivering(spool, postgres, schema):
            pass
        rows = delivered(postgres, schema)
        assert rows.items() >= held(reader).items()
    [before, (first, last)] = postgres.ask(f"SELECT first, last FROM {quoted(schema)}.reached ORDER BY first")
    assert (*before, last) == (1, 100, spool.last)
    assert len(rows) == 100 + last - first + 1


def test_a_clock_that_shows_nonsense_hinders_nothing(spool: Spool, postgres: Server, schema: str) -> None:
    with delivering(spool, postgres, schema):
        for at in (-1e300, -1.0, 0.0, 1e300):
            spool.add(LAYOUT, at, 0.0, "", [1.0, 2.0, 3.0])
        spool.commit()
    years = postgres.ask(f"SELECT extract(year FROM time) FROM {quoted(schema)}.gd350 ORDER BY seq")
    assert [int(year) for (year,) in years] == [9999, 9999, 1970, 9999]


@pytest.fixture
def batches(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """The first and the last number of each batch, ten samples at most, as they are delivered."""
    monkeypatch.setattr(delivery, "_BEGINS_WITH", 10)
    monkeypatch.setattr(delivery, "_MOST", 10)
    seen: list[tuple[int, int]] = []
    put = Session.put

    def seen_too(self: Session, samples: Sequence[Spooled]) -> None:
        put(self, samples)
        seen.append((samples[0].seq, samples[-1].seq))

    monkeypatch.setattr(Session, "put", seen_too)
    return seen


def test_the_present_goes_before_what_waited(
    spool: Spool, postgres: Server, schema: str, batches: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    feed(spool, 100)
    put = Session.put

    def come_meanwhile(self: Session, samples: Sequence[Spooled]) -> None:
        put(self, samples)
        if len(batches) in (2, 4):
            feed(spool, 1)

    monkeypatch.setattr(Session, "put", come_meanwhile)
    with delivering(spool, postgres, schema):
        pass
    assert batches[:7] == [(1, 10), (11, 20), (101, 101), (21, 30), (102, 102), (31, 40), (41, 50)]
    equal(spool, postgres, schema)


def test_more_than_can_be_delivered_as_it_comes_waits(
    spool: Spool, postgres: Server, schema: str, batches: list[tuple[int, int]]
) -> None:
    with delivering(spool, postgres, schema) as sink:
        until(lambda: is_in(sink))
        feed(spool, 35)
    assert batches == [(26, 35), (1, 10), (11, 20), (21, 25)]
    equal(spool, postgres, schema)


def test_over_a_long_way_as_many_samples_go_at_a_time(
    spool: Spool, postgres: Server, schema: str, batches: list[tuple[int, int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(delivery, "_SLOW", -1.0)
    feed(spool, 40)
    with delivering(spool, postgres, schema):
        pass
    assert batches == [(1, 10), (11, 20), (21, 30), (31, 40)]
