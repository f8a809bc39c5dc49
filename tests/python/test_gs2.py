"""AutomationDirect GS2: its commands, each in a register of its own, and what is told from it before a write.

LinuxCNC, gs2_vfd.c; DURApulse GS3 manual (easymanua.ls automationdirect durapulse-gs3-4030), p. 162. 01 06 091B 0001
runs one and 0000 stops it, as somebody noted who did it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

from drivebus import Bus, Drive, NotAllowed, Simulator, State

from .obedient import obedient, written

SETPOINT, RUN, DIRECTION, EXTERNAL_FAULT, RESET = 0x091A, 0x091B, 0x091C, 0x091D, 0x091E
SOURCES = [(0x0300, 3), (0x0400, 5)]
"""P3.00 = 3 and P4.00 = 5."""


@pytest.fixture
def line() -> Iterator[Simulator]:
    """One whose P3.00 and P4.00 somebody has set."""
    with obedient("gs2", SOURCES) as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "gs2", unverified=True)


def test_the_direction_goes_first_and_the_run_alone(line: Simulator, drive: Drive) -> None:
    drive.run(20.0)
    assert written(line) == [(SETPOINT, 200), (DIRECTION, 0), (RUN, 1)]
    drive.wait_for_speed(20.0, timeout=60.0)
    assert line.drive(1).frequency == 20.0
    drive.stop()
    assert written(line) == [(RUN, 0)]
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    drive.run(12.5, reverse=True)
    assert written(line) == [(SETPOINT, 125), (DIRECTION, 1), (RUN, 1)]
    drive.wait_for_speed(12.5, timeout=60.0)
    assert (drive.state(), line.drive(1).frequency) == (State.REVERSE, -12.5)


def test_each_word_is_a_request_of_its_own(line: Simulator, drive: Drive) -> None:
    drive.run(30.0)
    frames = [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] in (0x06, 0x10)]
    assert [frame[:-6] for frame in frames[2:]] == ["01 06 09 1a 01 2c", "01 06 09 1c 00 00", "01 06 09 1b 00 01"]


def test_nothing_moves_by_what_is_printed_alone(line: Simulator) -> None:
    with Bus(line) as bus:
        for start in (Drive.run, lambda drive: drive.run(20.0)):
            with pytest.raises(NotAllowed):
                start(bus.drive(1, "gs2"))
    assert written(line) == []


def test_a_fault_is_reset_in_a_register_of_its_own(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(4)
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run(10.0)
    drive.reset_fault()
    assert written(line) == [(RESET, 1)]
    assert drive.fault() is None


def test_who_gives_the_commands_is_set() -> None:
    with Simulator({1: "gs2"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "gs2", unverified=True)
        drive.prepare_control(store=True)
        assert written(line) == SOURCES


def test_where_its_stop_coasts_it_is_told_when_it_stands(line: Simulator, drive: Drive) -> None:
    """P1.00 = 1."""
    drive.bus.write(1, 0x0100, 1)
    drive.run(40.0)
    line.advance(30.0)
    drive.stop()
    assert line.drive(1).frequency == 0.0


@pytest.mark.parametrize("hertz", [20.0, 41.6, 26.4])
@pytest.mark.parametrize("named", ["ms300", "vfd-e", "gd350", "gd35", "a1000", "acs355"])
def test_a_stop_by_another_name_stops_it(line: Simulator, drive: Drive, named: str, hertz: float) -> None:
    """At 41.6 Hz 2103H is 01A0H, the code of a GD350, and at 26.4 Hz 0108H, that of a GD35."""
    drive.run(hertz)
    line.advance(20.0)
    assert line.drive(1).frequency == hertz
    with Bus(line) as bus, suppress(NotAllowed):
        bus.drive(1, named, unverified=True).stop()
    line.advance(20.0)
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)


@pytest.mark.parametrize("family", ["gs2", "ms300", "vfd-e"])
def test_each_is_known_by_its_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (family, "by answers")
