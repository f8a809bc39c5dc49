"""Nowforever D100 and E100: the words of five programs for real ones.

bdring/FluidNC (NowForeverProtocol.cpp), havardAasen/nowforever_vfd, babs/cnc-linuxcnc-nowforever_vfd,
buildbotics/bbctrl-firmware (vfd_spindle.c), grblHAL/Plugins_spindle (nowforever.c).
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivebus import Bus, Drive, NotAllowed, Simulator, State


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "nowforever"}, transport="process", clock="virtual") as simulator:
        with Bus(simulator) as bus:
            bus.write(1, 0x0000, [2])
            bus.write(1, 0x0002, [6])
        simulator.drive(1).take_writes()
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "nowforever", unverified=True)


def sent(line: Simulator) -> list[tuple[int, int]]:
    return [(place, word) for _, place, word in line.drive(1).take_writes()]


def test_it_runs_either_way_and_stops(line: Simulator, drive: Drive) -> None:
    drive.run(100.0)
    assert line.drive(1).state == "forward"
    drive.stop()
    drive.run(100.0, reverse=True)
    assert drive.status().state is State.REVERSE
    drive.stop()
    assert line.drive(1).state == "stopped"
    taken = sent(line)
    assert [word for place, word in taken if place == 0x0900] == [1, 0, 3, 0]
    assert set(taken) - {(0x0901, 0x2710)} == {(0x0900, 0), (0x0900, 1), (0x0900, 3)}


def test_it_is_written_by_10h_only(line: Simulator, drive: Drive) -> None:
    """As each of the five programs does."""
    drive.run(100.0)
    drive.stop()
    written = {data[1] for _, who, data in line.line.trace() if who == "master" and data[1] in (0x05, 0x06, 0x0F, 0x10)}
    assert written == {0x10}


def test_it_does_not_run_without_unverified(line: Simulator) -> None:
    with Bus(line) as bus, pytest.raises(NotAllowed):
        bus.drive(1, "nowforever").run(20.0)
    assert sent(line) == []


def test_it_has_no_coast(line: Simulator, drive: Drive) -> None:
    with pytest.raises(NotAllowed):
        drive.coast()
    assert sent(line) == []


def test_a_fault_is_its_number_and_bit_3_resets_it(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(7)
    status = drive.status()
    assert status.state is State.FAULT
    assert status.fault is not None
    assert status.fault.code == 7
    drive.reset_fault()
    assert sent(line)[-1] == (0x0900, 8)
    assert drive.status().state is State.STOPPED


def test_it_is_known_by_its_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == ("nowforever", "by answers")
