"""drivebus alone through every row, with a unit that answers 08H and with one that is silent on it.

And once more through another program that has the port.
"""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Sequence
from pathlib import Path

import pytest

if os.name == "nt":
    pytest.skip("no pty", allow_module_level=True)

from drivebus.sim import Simulator

from . import faults, wire
from .child import Outcome
from .faults import ALL, Tally, spoilt, spoilt_reads
from .play import play
from .report import counts
from .rows import ROWS, Row
from .slave import UNIT as UNIT_NUMBER
from .slave import Slave

# Longer than for the published table: on a busy machine a right answer shall not come too late, nor a call look hung.
TIMEOUT = 0.4
BOUND = 60.0

LIBRARY = pytest.mark.parametrize("library", ["drivebus", "drivebus_shared"])
UNIT = pytest.mark.parametrize(
    ("library", "silent_on_08"),
    [("drivebus", False), ("drivebus", True), ("drivebus_shared", False)],
    ids=["08H", "no 08H", "shared"],
)


def test_the_judge_knows_the_check_value_of_crc_16_modbus() -> None:
    assert wire.crc(b"123456789") == bytes.fromhex("37 4B")


def test_the_slave_outlives_a_port_that_goes_just_before_it_is_watched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = threading.Event()
    watch = select.select

    def goes_first(read: Sequence[int], write: Sequence[int], rare: Sequence[int], timeout: float | None) -> object:
        if len(read) > 1 and not gone.is_set():
            slave.vanish()
            gone.set()
        return watch(read, write, rare, timeout)

    with Slave(tmp_path) as slave, monkeypatch.context() as patch:
        patch.setattr(select, "select", goes_first)
        slave.vanish()
        slave.appear()
        assert gone.wait(10.0)
        patch.undo()
        slave.appear()
        master = os.open(slave.port, os.O_RDWR | os.O_NOCTTY)
        os.write(master, wire.frame(1, bytes.fromhex("03 00 05 00 01")))
        ready, _, _ = select.select([master], [], [], 10.0)
        assert ready
        assert os.read(master, 64) == wire.read_reply(1, [5])
        os.close(master)


@UNIT
@pytest.mark.parametrize("row", ROWS, ids=[row.key for row in ROWS])
def test_the_truth_is_told_in_every_row(row: Row, library: str, silent_on_08: bool) -> None:
    result = play(row, library, mute=silent_on_08, timeout=TIMEOUT, bound=BOUND)
    assert result.verdict.keeps(row.must), result
    assert result.recovery.wrong == 0, result
    assert result.recovery.seconds is not None, result


def ten_reads(*, fail: range) -> Tally:
    """A row by a reader whose reads of these numbers fail, where 0 is the first of the row."""
    number = -2

    def read(_address: int, values: list[int]) -> Outcome:
        nonlocal number
        number += 1  # one is read before the row
        return Outcome(0.0, error="NoAnswer") if number in fail else Outcome(0.0, result=values)

    with Simulator({UNIT_NUMBER: "gd350"}, transport="process", clock="virtual") as simulator:
        return spoilt_reads(simulator, read, "silence", reads=10)


def test_a_reader_whose_last_read_alone_failed_did_not_stop() -> None:
    tally = ten_reads(fail=range(9, 12))
    assert tally.ends == {"right": 9, "error": 1}
    assert tally.recovered
    assert counts(tally) == "9 / 0 / 1 / 0"


def test_a_reader_that_never_reads_again_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(faults, "PATIENCE", 0.1)
    assert counts(ten_reads(fail=range(9, 10_000))) == "9 / 0 / 1 / 0, stopped"


def test_a_reader_has_its_patience_within_a_row_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(faults, "GIVEN_UP", 2)
    assert counts(ten_reads(fail=range(4, 8))) == "6 / 0 / 4 / 0"


@LIBRARY
def test_no_fault_of_the_simulator_makes_an_answer_wrong(library: str) -> None:
    tally = spoilt(library, ALL, reads=60)
    assert tally.hits > 0, tally
    assert tally.ends["wrong"] == tally.ends["hung"] == 0, tally
