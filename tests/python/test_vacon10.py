"""A Vacon 10: its control word, its setpoint in shares, and an ACS355, which has parameters at the same places.

Vacon 10 user's manual (easymanua.ls vacon 10), p. 95: 42001 is the control word, 42003 the setpoint in 0.01 %, 42101
the status word, 42104 the output frequency. wirenboard/wb-mqtt-serial, config-vacon10.json: one less on the wire; bits
0 run, 1 counter-clockwise, 2 reset. M-Max manual MN04020003E, pp. 148 and 153: ID 125 = 3, ID 117 = 2, bit 3 coasts,
53 is the fault of a silent bus. Bytes are typed by hand.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

from drivebus import Bus, Drive, DrivebusError, NotAllowed, NotReady, Simulator, State

from .jobs import asked

OBEY = ["01 06 00 7C 00 03", "01 06 00 74 00 02"]
RUN_FORWARD = "01 06 07 D0 00 01"
RUN_REVERSE = "01 06 07 D0 00 03"
STOP = "01 06 07 D0 00 00"
COAST = "01 06 07 D0 00 08"
RESET = "01 06 07 D0 00 04"
# 40.00 % and 25.00 % of 50 Hz.
SET_20_HZ = "01 06 07 D2 0F A0"
SET_12_5_HZ = "01 06 07 D2 09 C4"


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "vacon10"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, "vacon10", unverified=True)
        drive.prepare_control(setpoint="frequency", store=True)
        yield drive


def written(line: Simulator) -> list[str]:
    """What was written, without CRCs, behind what makes it obey the bus."""
    frames = [frame[:-6] for frame in asked(line) if frame[3:5] in ("06", "10")]
    return frames[len(OBEY) :] if frames[: len(OBEY)] == OBEY else frames


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    drive.run(20.0)
    drive.wait_for_speed(20.0, timeout=30)
    assert (drive.state(), line.drive(1).frequency) == (State.FORWARD, 20.0)
    drive.stop()
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    drive.run(12.5, reverse=True)
    drive.wait_for_speed(12.5, timeout=30)
    assert (drive.state(), line.drive(1).frequency) == (State.REVERSE, -12.5)
    line.drive(1).trip(9)
    fault = drive.fault()
    assert fault is not None
    assert fault.code == 9
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run()
    drive.reset_fault()
    assert drive.fault() is None
    drive.run()
    drive.coast()
    assert written(line) == [SET_20_HZ, RUN_FORWARD, STOP, SET_12_5_HZ, RUN_REVERSE, RESET, RUN_FORWARD, COAST]


def test_a_share_is_of_what_the_drive_says(line: Simulator, drive: Drive) -> None:
    """P3.2 is ID 102: with 100.00 Hz, 20 Hz are 20.00 %."""
    drive.bus.write(1, 0x0065, 10_000)
    drive.run(20.0)
    drive.wait_for_speed(20.0, timeout=30)
    assert line.drive(1).frequency == 20.0
    assert written(line)[1:] == ["01 06 07 D2 07 D0", RUN_FORWARD]


def test_where_it_counts_from_another_frequency_nothing_is_set(line: Simulator, drive: Drive) -> None:
    """P3.1 is ID 101: with 20.00 Hz, 10 of 50 Hz would be 26 Hz."""
    drive.bus.write(1, 0x0064, 2_000)
    with pytest.raises(NotReady, match=r"P3\.1"):
        drive.run(10.0)
    assert written(line)[1:] == []
    assert line.drive(1).state == "stopped"


def test_p3_1_is_never_set_by_itself(line: Simulator, drive: Drive) -> None:
    drive.bus.write(1, 0x0064, 2_000)
    with suppress(NotAllowed):
        drive.prepare_control(setpoint="frequency", store=True)
    assert written(line)[1:] == []


def test_nothing_moves_by_what_is_printed_alone(line: Simulator) -> None:
    with Bus(line) as bus:
        for job in (lambda drive: drive.run(20.0), Drive.run, Drive.stop, Drive.reset_fault):
            with pytest.raises(NotAllowed):
                job(bus.drive(1, "vacon10"))
    assert written(line) == []


def test_a_silent_bus_trips_it(line: Simulator, drive: Drive) -> None:
    """S2.7 is ID 814, in seconds."""
    drive.bus.write(1, 0x032D, 3)
    drive.run(20.0)
    line.advance(4.0)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.label) == (53, "Silent fieldbus")


@pytest.mark.parametrize("job", ["run", "stop", "reset"])
def test_an_acs355_keeps_its_parameters_2001_and_2003(job: str) -> None:
    """40104 is parameter 0104 (ACS355 user's manual, p. 313), so 42001 is 2001."""
    with Simulator({1: "acs355"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "vacon10", unverified=True)
        with suppress(DrivebusError):
            {"run": lambda: drive.run(20.0), "stop": drive.stop, "reset": drive.reset_fault}[job]()
        assert [frame for frame in written(line) if frame.startswith("01 06 07")] == []


@pytest.mark.parametrize("family", ["vacon10", "acs355", "acs580", "frenic", "v20"])
def test_each_is_known_by_its_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (family, "by answers")
