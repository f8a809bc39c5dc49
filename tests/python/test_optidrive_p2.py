"""Invertek Optidrive P2: the words of an Optidrive E3, obeyed by another parameter.

Optidrive P2 user guide 3.07 (manualshive 1390699), p. 66, and 3.00 (manualslib 1494676), p. 62: registers, counted from
1, and their bits; easy start up manual (manualslib 1697910), p. 46: P1-12 = 4. Frames are typed by hand, one less on
the wire.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

from drivebus import Bus, DrivebusError, NotAllowed, Simulator, State

from .jobs import written

OBEYS = {"optidrive-p2": (0x006F, 4), "optidrive-e3": (0x008B, 3), "dc1": (0x008B, 3)}


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "optidrive-p2"}, transport="process", clock="virtual") as line:
        yield line


def test_a_whole_job(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "optidrive-p2", unverified=True)
        drive.prepare_control(store=True)
        drive.run(20.0)
        drive.wait_for_speed(20.0, timeout=100.0)
        assert (drive.state(), line.drive(1).frequency) == (State.RUNNING, 20.0)
        drive.stop()
        assert line.drive(1).frequency == 0.0
        line.drive(1).trip(3)
        drive.reset_fault()
        drive.coast()
    assert written(line) == [
        "01 06 00 6F 00 04",
        "01 06 00 01 00 C8",
        "01 06 00 00 00 01",
        "01 06 00 00 00 00",
        "01 06 00 00 00 04",
        "01 06 00 00 00 08",
    ]


def test_nothing_is_sent_without_unverified(line: Simulator) -> None:
    """No page of it says that register 1 is 0000H on the wire."""
    with Bus(line) as bus:
        drive = bus.drive(1, "optidrive-p2")
        for call in (drive.run, drive.stop, drive.coast, drive.reset_fault):
            with pytest.raises(NotAllowed):
                call()
    assert written(line) == []


def test_a_fault_is_the_high_byte(line: Simulator) -> None:
    line.drive(1).trip(4)
    with Bus(line) as bus:
        fault = bus.drive(1, "optidrive-p2", unverified=True).fault()
    assert fault is not None
    assert fault.code == 4


@pytest.mark.parametrize("unit", OBEYS)
@pytest.mark.parametrize("named", OBEYS)
def test_each_is_halted_by_any_name_and_run_by_its_own(unit: str, named: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            for place, word in (OBEYS[unit], (0x0001, 200), (0x0000, 1)):
                bus.write(1, place, word)
        line.advance(60.0)
        assert line.drive(1).frequency == 20.0
        line.drive(1).take_writes()
        with Bus(line) as bus:
            bus.drive(1, named, unverified=True).stop()
            assert [(place, word) for _, place, word in line.drive(1).take_writes()] == [(0x0000, 0)]
            assert line.drive(1).frequency == 0.0
        with Bus(line) as bus, suppress(DrivebusError):
            bus.drive(1, named, unverified=True).run(20.0)
        line.advance(60.0)
        assert line.drive(1).frequency == (20.0 if unit == named else 0.0)


@pytest.mark.parametrize("unit", OBEYS)
def test_each_is_known_by_its_answers(unit: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (unit, "by answers")
