"""Teco F510: what its maker's pages print, and how it is told from an E510, which takes the same words.

F510 communication addendum (Teco-Westinghouse), pp. 1-4 to 1-8, 1-14 to 1-24, 1-34 and 1-42; F510 manual (easymanua.ls
teco f510-series), p. 455; E510 communication addendum (Teco-Westinghouse), pp. 1-6 and 1-13 to 1-18.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, DrivebusError, NotAllowed, Simulator, State

SISTERS = {"e510": 5, "f510": 3}
"""What 00-05 is where the frequency comes from the bus."""


def obeying(unit: str, line: Simulator) -> None:
    with Bus(line) as bus:
        bus.write(1, 0x0002, 2)
        bus.write(1, 0x0005, SISTERS[unit])
        bus.write(1, 0x2502, 2_000)
    line.drive(1).take_writes()


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "f510"}, transport="process", clock="virtual") as simulator:
        yield simulator


def sent(line: Simulator) -> list[str]:
    return [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] in (0x06, 0x10)]


def test_a_whole_job_needs_nothing_unverified(line: Simulator) -> None:
    """01 06 25 01 00 01 12 C6 is forward, 00 03 93 07 reverse, 00 00 D3 06 stops it (p. 455)."""
    with Bus(line) as bus:
        drive = bus.drive(1, "f510")
        drive.prepare_control(store=True)
        drive.run(20.0)
        drive.wait_for_speed(20.0, timeout=60.0)
        drive.stop()
        drive.run(reverse=True)
        assert drive.state() is State.REVERSE
        drive.stop()
        assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    assert [(place, word) for _, place, word in line.drive(1).writes()][:2] == [(0x0002, 2), (0x0005, 3)]
    frames = sent(line)
    assert frames[2].startswith("01 10 25 01 00 02 04 00 01 07 d0")
    assert frames[3:] == ["01 06 25 01 00 00 d3 06", "01 06 25 01 00 03 93 07", "01 06 25 01 00 00 d3 06"]


def test_a_setpoint_above_its_range_is_not_sent(line: Simulator) -> None:
    """0 to 400.00 Hz (p. 1-34)."""
    with Bus(line) as bus:
        drive = bus.drive(1, "f510")
        with pytest.raises(drivebus.DrivebusError, match="400"):
            drive.setpoint = 400.01
        drive.setpoint = 400.0
    assert len(sent(line)) == 1


@pytest.mark.parametrize(
    ("number", "shown"), [(1, "UV"), (4, "OH1"), (17, "EF1"), (28, "CE"), (29, "STO"), (36, "LSCFT"), (46, "OH4")]
)
def test_its_faults_are_those_of_its_own_table(line: Simulator, number: int, shown: str) -> None:
    """Pp. 1-6 and 1-7; the short names of 17 and 36: p. 1-43. 1 is OH on an E510, 4 is OV, 28 is STP2."""
    line.drive(1).trip(number)
    with Bus(line) as bus:
        drive = bus.drive(1, "f510")
        fault = drive.fault()
        assert fault is not None
        assert (fault.code, fault.mnemonic) == (number, shown)
        bus.write(1, 0x0002, 2)
        drive.reset_fault()
        assert drive.fault() is None


@pytest.mark.parametrize(
    ("request_", "exception"),
    [
        ("04 25 20 00 01", 0x01),
        ("03 20 00 00 01", 0x02),
        ("03 25 03 00 01", 0x02),
        ("03 25 20 00 11", 0x03),
        ("06 25 02 9c 41", 0x04),
    ],
)
def test_it_refuses_by_the_table_of_the_addendum(line: Simulator, request_: str, exception: int) -> None:
    with Bus(line) as bus, pytest.raises(drivebus.Refused) as refused:
        bus.transact(1, bytes.fromhex(request_))
    assert refused.value.code == exception


@pytest.mark.parametrize("unit", SISTERS)
def test_each_is_known_by_its_answers(unit: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (unit, "by answers")


@pytest.mark.parametrize("unit", SISTERS)
@pytest.mark.parametrize("named", SISTERS)
def test_each_is_halted_by_either_name_and_run_by_its_own(unit: str, named: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        obeying(unit, line)
        with Bus(line) as bus:
            bus.write(1, 0x2501, 1)
        line.advance(30.0)
        assert line.drive(1).frequency == 20.0
        line.drive(1).take_writes()
        with Bus(line) as bus:
            bus.drive(1, named, unverified=True).stop()
            assert [(place, word) for _, place, word in line.drive(1).take_writes()] == [(0x2501, 0)]
            assert line.drive(1).frequency == 0.0
        with Bus(line) as bus, suppress(DrivebusError):
            bus.drive(1, named, unverified=True).run(20.0)
        line.advance(30.0)
        assert line.drive(1).frequency == (20.0 if unit == named else 0.0)


@pytest.mark.parametrize(("unit", "named"), [("e510", "f510"), ("f510", "e510")])
def test_neither_is_prepared_as_the_other(unit: str, named: str) -> None:
    """3 and 5 at 00-05 are other sources for the other one."""
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        with pytest.raises(NotAllowed):
            bus.drive(1, named, unverified=True).prepare_control(store=True)
        assert line.drive(1).writes() == []


A510 = """
name = "a510"
title = "Teco A510"
version = 1
source = "A510 communication addendum (Teco-Westinghouse), groups 0 to 22"
drop = ["23-00"]

[extends]
profile = "f510"
assumption = "It has the same words."

[identification.signature]
answers = ["status_word_1", "running_frequency"]
"""


def test_an_a510_is_taken_for_neither(tmp_path: Path) -> None:
    """It has 20-00 at 1400H, and its table ends at group 22: its setpoint may count tenths of a hertz."""
    (tmp_path / "a510").mkdir()
    (tmp_path / "a510" / "profile.toml").write_text(A510, encoding="utf-8")
    unit = str(tmp_path / "a510")
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            assert bus.read(1, 0x1400) == [0]
            with pytest.raises(drivebus.Refused):
                bus.read(1, 0x1700)
            assert bus.identify(1).family is None
        for named in SISTERS:
            with Bus(line) as bus, suppress(DrivebusError):
                bus.drive(1, named, unverified=True).run(20.0)
        assert line.drive(1).writes() == []
