"""AutomationDirect GS4: it runs by the words of a Delta drive, and is told from a GS2, which has half of its registers.

DURApulse GS4 user manual of 2017 (easymanua.ls automation-direct durapulse-gs4), pp. 118, 119, 279, 313 and 502.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

from drivebus import Bus, Drive, NotAllowed, Profile, Simulator, State

from .obedient import obedient, written

COMMAND, SETPOINT, FAULTS = 0x2000, 0x2001, 0x2002
SOURCES = [(0x0300, 3), (0x0400, 1)]
"""P3.00 = 3 and P4.00 = 1."""


@pytest.fixture
def line() -> Iterator[Simulator]:
    """One whose P3.00 and P4.00 somebody has set."""
    with obedient("gs4", SOURCES) as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "gs4", unverified=True)


def test_its_words_are_those_of_a_delta_drive(line: Simulator, drive: Drive) -> None:
    drive.run(15.0)
    assert written(line) == [(COMMAND, 0x12), (SETPOINT, 1500)]
    drive.wait_for_speed(15.0, timeout=60.0)
    assert line.drive(1).frequency == 15.0
    drive.stop()
    assert written(line) == [(COMMAND, 1)]
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    drive.run(12.5, reverse=True)
    assert written(line) == [(COMMAND, 0x22), (SETPOINT, 1250)]
    drive.wait_for_speed(12.5, timeout=60.0)
    assert (drive.state(), line.drive(1).frequency) == (State.REVERSE, -12.5)


def test_both_words_are_one_request_as_its_manual_writes_them(line: Simulator, drive: Drive) -> None:
    """P. 321 writes 0002H and 0258H, 6.00 Hz, to 2000H and 2001H: 01 10 2000 0002 04 0002 0258."""
    drive.run(6.0)
    frames = [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] in (0x06, 0x10)]
    assert [frame[:-6] for frame in frames[2:]] == ["01 10 20 00 00 02 04 00 12 02 58"]


def test_it_runs_by_what_is_printed(line: Simulator) -> None:
    with Bus(line) as bus:
        bus.drive(1, "gs4").run(20.0)
    line.advance(20.0)
    assert line.drive(1).frequency == 20.0


def test_it_is_stopped_by_what_is_printed(line: Simulator, drive: Drive) -> None:
    drive.run(20.0)
    line.advance(10.0)
    written(line)
    with Bus(line) as bus:
        bus.drive(1, "gs4").stop()
    assert written(line) == [(COMMAND, 1)]
    assert line.drive(1).frequency == 0.0


def test_a_fault_has_the_number_that_is_printed(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(49)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (49, "EF")
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run(10.0)
    drive.reset_fault()
    assert written(line) == [(FAULTS, 2)]
    assert drive.fault() is None


def test_who_gives_the_commands_is_set() -> None:
    with Simulator({1: "gs4"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "gs4", unverified=True)
        drive.prepare_control(store=True)
        assert written(line) == SOURCES


@pytest.mark.parametrize("hertz", [20.0, 4.16, 2.64])
@pytest.mark.parametrize("named", ["gs2", "ms300", "vfd-e", "yl620", "gd350", "gd35", "a1000", "acs355", "eds300"])
def test_a_stop_by_another_name_stops_it(line: Simulator, drive: Drive, named: str, hertz: float) -> None:
    """At 4.16 Hz 2103H is 01A0H, the code of a GD350, and at 2.64 Hz 0108H, that of a GD35."""
    drive.run(hertz)
    line.advance(20.0)
    assert line.drive(1).frequency == hertz
    with Bus(line) as bus, suppress(NotAllowed):
        bus.drive(1, named, unverified=True).stop()
    line.advance(20.0)
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)


@pytest.mark.parametrize("family", ["gs2", "gs4", "ms300", "vfd-e"])
def test_each_is_known_by_its_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (family, "by answers")


def test_its_line_is_the_one_from_the_factory() -> None:
    serial = Profile.builtin("gs4").serial()
    assert serial is not None
    assert (serial.baud_rate, serial.format, serial.unit) == (9600, "8N1", 1)
