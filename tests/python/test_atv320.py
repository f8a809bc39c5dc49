"""A Schneider Altivar 320: an Altivar 71 that goes forward only, and all of it unverified.

A program that runs one (robotsmith/Arduino_ATV320_library) writes 06H, 07H and 0FH, then 07H, and 80H behind a fault.
The addresses are those of a CANopen file for product 320 (hilch/ac_invlib). That it is told from its sisters before a
write is in `test_atv12`. The frames are those of `test_atv`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from drivebus import BadArgument, Bus, Drive, NotAllowed, Profile, Simulator, State

from .test_atv import COAST, FORWARD_10_HZ, RESET, SHUTDOWN, STOP, SWITCH_ON, written

CHCF = 8401
START = [SHUTDOWN, SWITCH_ON, FORWARD_10_HZ]


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "atv320"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, "atv320", unverified=True)
        drive.prepare_control(store=True)
        yield drive


def test_without_a_word_that_it_may_nothing_is_sent(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "atv320")
        orders: list[Callable[[], object]] = [lambda: drive.run(10.0), drive.stop, drive.coast, drive.reset_fault]
        for order in orders:
            with pytest.raises(NotAllowed, match="not verified"):
                order()
    assert line.drive(1).writes() == []


def test_it_runs_stops_coasts_and_resets(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    assert drive.state() is State.FORWARD
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0)
    drive.stop()
    drive.wait_until_stopped(timeout=30.0)
    drive.run(10.0)
    line.advance(20.0)
    drive.coast()
    line.advance(60.0)
    line.drive(1).trip(107)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (107, "SAFF")
    drive.reset_fault()
    assert drive.fault() is None
    assert written(line) == [*START, STOP, *START, COAST, RESET]


def test_it_has_no_word_for_the_other_direction(line: Simulator, drive: Drive) -> None:
    with pytest.raises(BadArgument, match="no command run_reverse"):
        drive.run(10.0, reverse=True)
    assert written(line) == []
    assert 0x080F not in Profile.builtin("atv320").command_registers()[8501]


def test_in_the_io_profile_nothing_is_started_and_nothing_set(line: Simulator, drive: Drive) -> None:
    drive.bus.write(1, CHCF, 3)
    before = len(line.drive(1).writes())
    with pytest.raises(NotAllowed, match=r"CHCF .*: 3, needs 1"):
        drive.run(10.0)
    assert len(line.drive(1).writes()) == before


def test_what_stands_on_it_leads_to_its_profile() -> None:
    for said in ("ATV320", "Altivar 320", "Altivar Machine 320", "Schneider Altivar 320"):
        assert Profile.builtin(said).name == "atv320"
