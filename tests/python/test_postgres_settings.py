"""What a PostgreSQL sink is told: no password where others see it, certificates verified; and what it remembers."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from psycopg.conninfo import conninfo_to_dict

from drivebus import NotAllowed
from drivebus.sinks import Postgres, PostgresSettings
from drivebus.sinks.intervals import Intervals
from drivebus.sinks.postgres_link import connection_string
from drivebus.spool import Spool

from .delivering import SIZE, quiet


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    with Spool(tmp_path / "spool", SIZE, quiet) as spool:
        yield spool


@pytest.mark.parametrize(
    ("mode", "says"),
    [(0o640, "others may read the password in .*: run chmod 600"), (None, "cannot be read: No such file")],
)
def test_a_password_file_that_others_may_read_is_refused(
    spool: Spool, tmp_path: Path, mode: int | None, says: str
) -> None:
    file = tmp_path / "password"
    if mode is not None:
        file.write_text("secret")
        file.chmod(mode)
    with pytest.raises(NotAllowed, match=says):
        Postgres(spool, PostgresSettings("host=db", "gateway 1", password_file=file), quiet)


@pytest.mark.parametrize(
    ("told", "says"),
    [
        ("host=db password=hunter2", "put it into a file"),
        ("postgresql://user:hunter2@db/base", "put it into a file"),
        ("host=db hunter2", "cannot be read"),
    ],
)
def test_a_password_among_the_settings_is_refused_and_not_repeated(spool: Spool, told: str, says: str) -> None:
    with pytest.raises(NotAllowed, match=says) as refused:
        Postgres(spool, PostgresSettings(told, "gateway 1"), quiet)
    assert "hunter2" not in str(refused.value)


@pytest.mark.parametrize(
    ("told", "mode"),
    [
        ("host=db.example.com", "verify-full"),
        ("postgresql://db.example.com/base", "verify-full"),
        ("host=localhost,10.0.0.1", "verify-full"),
        ("host=localhost hostaddr=10.0.0.1", "verify-full"),
        ("service=plant", "verify-full"),
        ("host=db.example.com sslmode=require", "require"),
        ("host=localhost,127.0.0.1,::1", None),
        ("host=/run/postgresql", None),
        ("host=@name", None),
        ("dbname=base", None),
    ],
)
def test_certificates_of_other_computers_are_verified(
    told: str, mode: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PGHOST", "PGHOSTADDR", "PGSSLMODE", "PGSERVICE"):
        monkeypatch.delenv(name, raising=False)
    assert conninfo_to_dict(connection_string(told, "drivebus", None)).get("sslmode") == mode
    monkeypatch.setenv("PGHOST", "db.example.com")
    assert conninfo_to_dict(connection_string("", "drivebus", None))["sslmode"] == "verify-full"


def test_without_psycopg_it_says_what_to_install(spool: Spool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "drivebus.sinks.postgres_session")
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(NotAllowed, match=r"PostgreSQL needs psycopg: pip install 'drivebus\[postgres\]'"):
        Postgres(spool, PostgresSettings("", "gateway 1"), quiet)


SOME = st.lists(st.tuples(st.integers(1, 60), st.integers(0, 9)))


@given(SOME, SOME)
def test_what_is_removed_is_in_no_interval(added: list[tuple[int, int]], removed: list[tuple[int, int]]) -> None:
    intervals, numbers = Intervals(), set[int]()
    for first, length in added:
        intervals.add(first, first + length)
        numbers |= {*range(first, first + length + 1)}
    for first, length in removed:
        intervals.remove(first, first + length)
        numbers -= {*range(first, first + length + 1)}
    assert {number for first, last in intervals for number in range(first, last + 1)} == numbers
    assert all(before + 1 < first for (_, before), (first, _) in pairwise(intervals))


@given(SOME)
def test_intervals_are_what_a_set_of_numbers_is(added: list[tuple[int, int]]) -> None:
    intervals, numbers = Intervals(), set[int]()
    written: list[tuple[int, int]] = []
    for first, length in added:
        change = intervals.add(first, first + length)
        numbers |= {*range(first, first + length + 1)}
        written = sorted({*written} - {*change.gone} | {change.come})
        assert len(written) == len({*written})
    assert written == list(intervals)
    assert {number for first, last in intervals for number in range(first, last + 1)} == numbers
    missing = {number for first, last in intervals.missing(5, 50) for number in range(first, last + 1)}
    assert missing == {*range(5, 51)} - numbers
    # Those that touch have grown together.
    assert all(before + 1 < first for (_, before), (first, _) in pairwise(written))
