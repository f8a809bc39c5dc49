"""Samples that wait in a file: nothing is changed, nothing is lost to a kill, and what a disk loses is told."""

from __future__ import annotations

import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivebus.errors import NotAllowed
from drivebus.service.changes import Changes
from drivebus.spool import Layout, Spool, Spooled
from drivebus.spool.proof import proof_of
from drivebus.values import digits_of

PUMP = Layout("pump", "gd350", ("running_frequency", "output_current", "state"), ("Hz", "A", ""), (2, 1, 0))
DAMAGED = "damaged in the spool"


def told(text: str) -> None:
    raise AssertionError(text)


def all_of(spool: Spool) -> list[Spooled]:
    reader = spool.reader("test")
    try:
        return reader.after(0, 1_000_000)
    finally:
        reader.close()


@given(st.data())
def test_packing_changes_no_value(data: st.DataObject) -> None:
    """Whether it counts as its drive says, or not at all."""
    digits = data.draw(st.lists(st.integers(0, 4), max_size=30))
    layout = Layout("a", "b", tuple(map(str, range(len(digits)))), ("",) * len(digits), tuple(digits))
    values = [
        data.draw(
            st.one_of(
                st.integers(-(2**33), 2**33).map(lambda raw, n=each: raw / 10**n if n else raw),  # type: ignore[misc]
                st.floats(allow_nan=False, allow_infinity=False, width=32) if each else st.integers(-(2**40), 2**40),
            )
        )
        for each in digits
    ]
    packed = layout.packed(values)
    assert list(layout.values(packed)) == values
    assert len(packed) in (1 + 4 * len(values), 1 + 8 * len(values))
    assert Layout.of_text(layout.text()) == layout


@given(st.binary(max_size=40))
def test_what_is_no_sample_is_an_error(packed: bytes) -> None:
    try:
        assert len(PUMP.values(packed)) == 3
    except ValueError:
        assert len(packed) not in (13, 25) or packed[:1] not in (b"i", b"d")


@pytest.mark.parametrize(("scale", "digits"), [(1, 0), (0.1, 0), (10, 1), (100, 2), (1_000, 3), (20, 2), (1e5, 5)])
def test_how_many_digits_a_scale_has(scale: float, digits: int) -> None:
    assert digits_of(scale) == digits


@given(
    st.lists(st.tuples(st.integers(-3, 9), st.sampled_from(["", "", "NoAnswer", "Refused"]), st.integers(0, 6))),
    st.integers(0, 3),
    st.integers(1, 20),
)
def test_what_is_kept(steps: list[tuple[int, str, int]], band: int, heartbeat: int) -> None:
    """By the words: what differs by more than its band, is missing, or comes after the heartbeat."""
    changes = Changes([band], heartbeat)
    now, last = 1000.0, None
    for pause, missing, value in steps:
        now += pause
        new = (now, missing, None if missing else value)
        expected = (
            last is None
            or now - last[0] >= heartbeat
            or now < last[0]
            or missing != last[1]
            or (new[2] is not None and last[2] is not None and abs(new[2] - last[2]) > band)
        )
        assert changes.keeps(now, missing, [] if missing else [value]) == expected
        last = new if expected else last


def test_a_reader_gets_them_in_order_from_where_it_was(quick_folder: Path) -> None:
    with Spool(quick_folder / "spool", 1 << 30, told) as spool:
        for turn in range(10):
            spool.add(PUMP, 100.0 + turn, 0.02, "", [turn / 100, 1.5, 3])
        spool.add(PUMP, 110.0, 0.5, "unit 1: no answer", [])
        reader = spool.reader("a")
        assert reader.after(0, 5) == []
        spool.commit()
        assert reader.wait(10, 0.0)
        assert not reader.wait(11, 0.0)
        first = reader.after(0, 5)
        assert [each.values for each in first] == [(turn / 100, 1.5, 3) for turn in range(5)]
        assert [each.seq for each in reader.after(5, 100, before=9)] == [6, 7, 8]
        assert reader.after(10, 5)[0][2:] == (PUMP, 110.0, 0.5, "unit 1: no answer", ())
        reader.reached(5)
        reader.close()
    with Spool(quick_folder / "spool", 1 << 30, told) as spool:
        assert (spool.reader("a").position(), spool.reader("b").position()) == (5, 0)
        spool.add(PUMP, 111.0, 0.02, "", [0, 0, 0])
        spool.commit()
        assert spool.last == 12
        assert len({each.epoch for each in all_of(spool)}) == 2
    assert (quick_folder / "spool").stat().st_mode & 0o777 == 0o600


def test_the_oldest_give_way_where_it_is_full(quick_folder: Path) -> None:
    heard: list[str] = []
    with Spool(quick_folder / "spool", 200_000, heard.append) as spool:
        for turn in range(100):
            for each in range(100):
                spool.add(PUMP, float(turn * 100 + each), 0.02, "", [1, 2, 3])
            spool.commit()
        kept = all_of(spool)
        assert kept[-1].seq == 10_000
        assert spool.lost == 10_000 - len(kept) == kept[0].seq - 1
        assert 2_000 < len(kept) < 8_000
    assert (quick_folder / "spool").stat().st_size < 300_000
    assert "is full: its oldest" in heard[0]


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files")
def test_a_disk_that_takes_nothing_is_told_once_and_nothing_is_lost(quick_folder: Path) -> None:
    import resource

    heard: list[str] = []
    with Spool(quick_folder / "spool", 1 << 30, heard.append) as spool:
        spool.add(PUMP, 1.0, 0.02, "", [1, 2, 3])
        spool.commit()
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1, limits[1]))
            for turn in range(3):
                spool.add(PUMP, 2.0 + turn, 0.02, "", [1, 2, 3])
                spool.commit()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            signal.signal(signal.SIGXFSZ, ignored)
        assert len(heard) == 1
        assert "takes nothing" in heard[0]
        spool.commit()
        assert [each.time for each in all_of(spool)] == [1.0, 2.0, 3.0, 4.0]
    assert "takes samples again" in heard[1]


WRITES = """
import sys
from pathlib import Path
from drivebus.spool import Layout, Spool
layout = Layout("pump", "gd350", ("a",), ("",), (0,))
spool = Spool(Path(sys.argv[1]), 1 << 30, print)
turn = 0
while True:
    for _ in range(7):
        turn += 1
        spool.add(layout, float(turn), 0.0, "", [turn])
    spool.commit()
    print(spool.last, flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_what_was_committed_outlives_a_kill(quick_folder: Path) -> None:
    chance = random.Random(1)
    had = 0
    for _ in range(5):
        line = [sys.executable, "-c", WRITES, str(quick_folder / "spool")]
        with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as program:
            assert program.stdout is not None
            for _ in range(chance.randrange(1, 40)):
                last = int(program.stdout.readline())
            os.kill(program.pid, signal.SIGKILL)
            last = max([last, *map(int, program.stdout.read().split("\n")[:-1])])
        with Spool(quick_folder / "spool", 1 << 30, told) as spool:
            kept = all_of(spool)
            assert [each.seq for each in kept] == list(range(1, len(kept) + 1))
            assert len(kept) >= last
            assert [each.values[0] for each in kept[had:]] == list(range(1, len(kept) - had + 1))
            had = len(kept)


def test_nobody_has_what_comes_under_numbers_that_are_given_again(quick_folder: Path) -> None:
    path, told = quick_folder / "spool", list[str]()
    with Spool(path, 1 << 30, told.append) as spool:
        for _ in range(20):
            spool.add(PUMP, 100.0, 0.02, "", [0, 0, 0])
        spool.commit()
        spool.reached("a", 20)
    # As a disk that keeps the one page and loses the other.
    with closing(sqlite3.connect(path)) as base, base:
        base.execute("DELETE FROM sample WHERE seq > 5")
        base.execute("UPDATE sqlite_sequence SET seq = 5 WHERE name = 'sample'")
    with Spool(path, 1 << 30, told.append) as spool:
        spool.add(PUMP, 101.0, 0.02, "", [0, 0, 0])
        spool.commit()
        with closing(spool.reader("a")) as reader:
            assert (reader.position(), spool.last) == (5, 6)


def test_cut_anywhere_it_gives_what_is_whole(quick_folder: Path) -> None:
    """A cut file either opens as it was, or is put aside; no sample is made up, and the next ones are kept."""
    whole = quick_folder / "whole"
    with Spool(whole, 1 << 30, told) as spool:
        for turn in range(3_000):
            spool.add(PUMP, float(turn), 0.02, "", [turn / 100, turn / 10, turn])
            if turn % 300 == 0:
                spool.commit()
        spool.commit()
        original = {each.seq: each for each in all_of(spool)}
    chance = random.Random(2)
    size = whole.stat().st_size
    saved = []
    for turn in range(100):
        cut = quick_folder / f"cut-{turn}"
        shutil.copy(whole, cut)
        with cut.open("r+b") as file:
            file.truncate(chance.randrange(size))
        heard: list[str] = []
        with Spool(cut, 1 << 30, heard.append) as spool:
            kept = all_of(spool)
            assert all(original[each.seq] == each for each in kept)
            assert len(heard) == 1 or not cut.stat().st_size
            saved.append(len(kept))
            spool.add(PUMP, 1e6, 0.02, "", [1, 2, 3])
            spool.commit()
            assert all_of(spool)[-1].epoch not in {each.epoch for each in original.values()}
    assert max(saved) > 1_500


@pytest.mark.parametrize(
    "content", [b"a text of somebody else's, long enough for a header of SQLite\n" * 100, b"\0" * 5_000]
)
def test_what_is_no_spool_is_put_aside(quick_folder: Path, content: bytes) -> None:
    path = quick_folder / "spool"
    path.write_bytes(content)
    heard: list[str] = []
    with Spool(path, 1 << 30, heard.append) as spool:
        assert all_of(spool) == []
    assert (quick_folder / "spool.damaged-1").read_bytes() == content
    assert "was damaged: 0 samples" in heard[0]


def test_what_cannot_be_opened_is_said(quick_folder: Path) -> None:
    with pytest.raises(OSError, match="No such file"):
        Spool(quick_folder / "none" / "spool", 1 << 30, told)
    (quick_folder / "folder").mkdir()
    with pytest.raises(NotAllowed, match="cannot be opened"):
        Spool(quick_folder / "folder", 1 << 30, told)


def test_a_sample_that_is_not_as_it_was_written_is_told_and_gives_no_values(quick_folder: Path) -> None:
    with Spool(quick_folder / "spool", 1 << 30, told) as spool:
        for turn in range(3):
            spool.add(PUMP, float(turn), 0.02, "", [1, 2, 3])
        spool.commit()
    base = sqlite3.connect(quick_folder / "spool")
    base.execute("UPDATE sample SET packed = zeroblob(13) WHERE seq = 2")
    base.execute("INSERT INTO layout VALUES (9, 'no layout')")
    row = (1, 9, 5.0, 0.02, "", b"i")
    base.execute("INSERT INTO sample VALUES (4, ?, ?, ?, ?, ?, ?, ?)", (*row, proof_of(*row)))
    base.commit()
    base.close()
    with Spool(quick_folder / "spool", 1 << 30, told) as spool:
        assert [each.missing for each in all_of(spool)] == ["", DAMAGED, "", DAMAGED]
        assert [each.values for each in all_of(spool)] == [(1, 2, 3), (), (1, 2, 3), ()]
