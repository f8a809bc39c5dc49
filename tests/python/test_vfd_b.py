"""Delta VFD-B: it runs as an MS300 and a VFD-E do, and the three are told apart by where their voltages are.

VFD-B manual of October 2005 (easymanua.ls delta vfd007b21a), p. 162; LinuxCNC, vfdb_vfd.c; buildbotics/bbctrl-firmware,
issue 328, for 02-00 and 02-01.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

from drivebus import Bus, Drive, NotAllowed, Simulator, State

from .obedient import obedient, written

COMMAND, SETPOINT, FAULTS = 0x2000, 0x2001, 0x2002
SOURCES = [(0x0201, 3), (0x0200, 5)]
"""02-01 = 3 and 02-00 = 5."""


@pytest.fixture
def line() -> Iterator[Simulator]:
    """One whose 02-00 and 02-01 somebody has set."""
    with obedient("vfd-b", SOURCES) as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "vfd-b", unverified=True)


def test_it_runs_by_the_words_that_programs_send(line: Simulator, drive: Drive) -> None:
    drive.run(20.0)
    assert written(line) == [(SETPOINT, 2000), (COMMAND, 0x12)]
    drive.wait_for_speed(20.0, timeout=60.0)
    assert line.drive(1).frequency == 20.0
    drive.stop()
    assert written(line) == [(COMMAND, 1)]
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    drive.run(12.5, reverse=True)
    assert written(line) == [(SETPOINT, 1250), (COMMAND, 0x22)]
    drive.wait_for_speed(12.5, timeout=60.0)
    assert (drive.state(), line.drive(1).frequency) == (State.REVERSE, -12.5)


def test_nothing_moves_by_what_is_printed_alone(line: Simulator) -> None:
    with Bus(line) as bus:
        for start in (Drive.run, lambda drive: drive.run(20.0)):
            with pytest.raises(NotAllowed):
                start(bus.drive(1, "vfd-b"))
    assert written(line) == []


def test_a_fault_is_reset(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(4)
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run(10.0)
    drive.reset_fault()
    assert written(line) == [(FAULTS, 2)]
    assert drive.fault() is None


def test_who_gives_the_commands_is_set() -> None:
    with Simulator({1: "vfd-b"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "vfd-b", unverified=True)
        drive.prepare_control(store=True)
        assert written(line) == SOURCES


@pytest.mark.parametrize("hertz", [20.0, 4.16, 2.64])
@pytest.mark.parametrize("named", ["ms300", "vfd-e", "yl620", "gs2", "gs4", "gd350", "gd35", "a1000", "eds300"])
def test_a_stop_by_another_name_stops_it(line: Simulator, drive: Drive, named: str, hertz: float) -> None:
    """At 4.16 Hz 2103H is 01A0H, the code of a GD350, and at 2.64 Hz 0108H, that of a GD35."""
    drive.run(hertz)
    line.advance(20.0)
    assert line.drive(1).frequency == hertz
    with Bus(line) as bus, suppress(NotAllowed):
        bus.drive(1, named, unverified=True).stop()
    line.advance(20.0)
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)


@pytest.mark.parametrize("family", ["vfd-b", "vfd-e", "ms300", "gs2", "gs4", "yl620"])
def test_each_is_known_by_its_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (family, "by answers")
