"""The spool: what was given to it is in it once, one program has it, and its epochs are found."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from drivebus import NotAllowed
from drivebus.spool import Layout, Spool

LAYOUT = Layout("pump", "gd350", ("output_current",), ("A",), (1,))
LARGE = 1 << 30


def quiet(_: str) -> None:
    """Hears what is told, and keeps it to itself."""


def add(spool: Spool, count: int) -> None:
    for number in range(count):
        spool.add(LAYOUT, 1e9 + number, 0.01, "", [number / 10])
    spool.commit()


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    with Spool(tmp_path / "spool", LARGE, quiet) as spool:
        yield spool


def test_what_is_in_the_file_is_not_written_again_where_old_samples_could_not_be_removed(
    spool: Spool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: Spool) -> None:
        raise sqlite3.OperationalError("database or disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(Spool, "_make_room", full)
        add(spool, 3)
    spool.commit()
    add(spool, 1)
    with closing(spool.reader("sink")) as reader:
        assert [each.seq for each in reader.after(0, 10)] == [1, 2, 3, 4]


def test_nobody_waits_at_a_closed_spool_and_nothing_came(tmp_path: Path) -> None:
    spool = Spool(tmp_path / "spool", LARGE, quiet)
    add(spool, 2)
    spool.close()
    assert spool.wait(1, 60.0)
    assert not spool.wait(2, 60.0)


def test_one_program_has_a_spool(spool: Spool) -> None:
    with pytest.raises(NotAllowed, match="another program has it"):
        Spool(spool.path, LARGE, quiet)
    spool.close()
    Spool(spool.path, LARGE, quiet).close()


def test_the_stretches_of_the_epochs(tmp_path: Path) -> None:
    counts, expected, last = (3, 0, 1, 1000, 7), [], 0
    for count in counts:
        with Spool(tmp_path / "spool", LARGE, quiet) as spool, closing(spool.reader("sink")) as reader:
            add(spool, count)
            if count:
                epoch = reader.after(last, 1)[0].epoch
                expected.append((epoch, last + 1, last + count))
                last += count
            assert [tuple(each) for each in reader.stretches()] == expected


def test_the_stretches_of_a_spool_without_its_oldest(tmp_path: Path) -> None:
    with Spool(tmp_path / "spool", 200_000, quiet) as spool, closing(spool.reader("sink")) as reader:
        assert reader.stretches() == []
        while not spool.lost:
            add(spool, 500)
        [(_, first, last)] = reader.stretches()
        assert (first, last) == (spool.lost + 1, spool.last)
