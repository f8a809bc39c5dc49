"""An Eaton PowerXL DC1: its command, its state, and an Optidrive E3, which has its addresses and other bits.

DC1 manual MN04020003Z-EN 12/13 (easymanua.ls powerxl-dc1-series), pp. 149 to 153: ID 1 is the command, bit 0 runs, 1
reverses, 2 resets, 3 coasts; ID 2 is the setpoint in tenths of a hertz; ID 6 is the state, and the fault in its high
byte. The same of 10/12 (manualshive 525259), p. 158: "01 06 0000 0001" runs it. Bytes are typed by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

from drivebus import Bus, Drive, DrivebusError, NotAllowed, Simulator, State

from .jobs import asked, carry_out_awaited, written

OBEY = "01 06 00 8B 00 03"
SET_20_HZ = "01 06 00 01 00 C8"
RUN_FORWARD = "01 06 00 00 00 01"
RUN_REVERSE = "01 06 00 00 00 03"
STOP = "01 06 00 00 00 00"
COAST = "01 06 00 00 00 08"
RESET = "01 06 00 00 00 04"


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "dc1"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "dc1", unverified=True)


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    return [
        lambda: drive.prepare_control(store=True),
        lambda: drive.run(20.0),
        lambda: drive.wait_for_speed(20.0, timeout=100),
        lambda: line.drive(1).trip(3),
        drive.reset_fault,
        lambda: line.advance(100.0),
        lambda: drive.run(reverse=True),
        drive.coast,
        lambda: line.advance(100.0),
        drive.run,
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=100),
    ]


WHOLE = [OBEY, SET_20_HZ, RUN_FORWARD, RESET, RUN_REVERSE, COAST, RUN_FORWARD, STOP]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert written(line) == WHOLE


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "dc1", program)
    assert written(line) == WHOLE


@pytest.mark.parametrize(("reverse", "state", "hertz"), [(False, State.FORWARD, 20.0), (True, State.REVERSE, -20.0)])
def test_which_way_it_turns_is_told(line: Simulator, drive: Drive, reverse: bool, state: State, hertz: float) -> None:
    drive.prepare_control(store=True)
    drive.run(20.0, reverse=reverse)
    line.advance(30.0)
    assert (drive.status().state, line.drive(1).frequency) == (state, hertz)
    drive.stop()
    assert (drive.status().state, line.drive(1).frequency) == (State.STOPPED, 0.0)


def test_a_fault_is_the_high_byte(line: Simulator, drive: Drive) -> None:
    drive.prepare_control(store=True)
    line.drive(1).trip(14)
    fault = drive.fault()
    assert fault is not None
    assert fault.code == 14
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run()
    drive.reset_fault()
    assert drive.fault() is None


def test_the_printed_frame_is_what_runs_it(line: Simulator) -> None:
    """Its setpoint stands there already, as does P-12: neither is asked for without `unverified`."""
    with Bus(line) as bus:
        bus.write(1, 0x008B, 3)
        bus.write(1, 0x0001, 200)
        drive = bus.drive(1, "dc1")
        drive.run()
        with pytest.raises(NotAllowed):
            drive.setpoint = 10.0
        line.advance(30.0)
        assert (drive.state(), line.drive(1).frequency) == (State.FORWARD, 20.0)
        drive.stop()
    assert "01 06 00 00 00 01 48 0A" in asked(line)
    assert line.drive(1).frequency == 0.0


def test_p_12_is_set_only_where_the_unverified_is_wanted(line: Simulator) -> None:
    with Bus(line) as bus, suppress(NotAllowed):
        bus.drive(1, "dc1").prepare_control(store=True)
    assert written(line) == []


@pytest.mark.parametrize("unit", ["dc1", "optidrive-e3"])
@pytest.mark.parametrize("named", ["dc1", "optidrive-e3"])
@pytest.mark.parametrize("reverse", [False, True])
def test_one_runs_by_its_own_name_only(unit: str, named: str, reverse: bool) -> None:
    """Bit 1 reverses the one, and stops the other along its second ramp."""
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.write(1, 0x008B, 3)
        with suppress(DrivebusError):
            bus.drive(1, named, unverified=True).run(20.0, reverse=reverse)
        line.advance(30.0)
        turns = unit == named and not (reverse and unit == "optidrive-e3")
        assert abs(line.drive(1).frequency) == (20.0 if turns else 0.0)


@pytest.mark.parametrize(
    "family", ["dc1", "optidrive-e3", "acs355", "acs580", "vacon10", "v20", "sj200", "wj200", "x200"]
)
def test_each_is_known_by_its_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (family, "by answers")
