"""LS Starvert and LSLV: a common area at low addresses, each one less on the wire than printed.

LSLV-S100 manual (easymanua.ls lsis s100), p. 141: one less. ACtionMaster manual (CMC; manualsonline and azmanual
65346), p. 81: the setpoint at 0005H, the command at 0006H, the state at 000EH, as printed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

import drivebus
from drivebus import Bus, Drive, DrivebusError, NotAllowed, Profile, Simulator, State

SETPOINT, COMMAND = 0x0004, 0x0005
FORWARD, REVERSE, STOP, RESET = 2, 4, 1, 8


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "starvert"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def bus(line: Simulator) -> Iterator[Bus]:
    with Bus(line) as bus:
        yield bus


@pytest.fixture
def drive(bus: Bus) -> Drive:
    return bus.drive(1, "starvert", unverified=True)


def written(line: Simulator) -> list[tuple[int, int]]:
    frames = [data for _, who, data in line.line.trace() if who == "master" and data[1] in (0x05, 0x06, 0x0F, 0x10)]
    assert all(data[1] == 0x06 for data in frames)
    return [(int.from_bytes(data[2:4], "big"), int.from_bytes(data[4:6], "big")) for data in frames]


def test_the_words_go_where_a_program_for_a_m100_writes_them(line: Simulator, drive: Drive) -> None:
    """RPi-Modbus-VFD: 40005 is 4 there, and the command the word behind; 2000 are 20 Hz."""
    drive.run(20.0)
    assert line.drive(1).state == "forward"
    assert written(line) == [(SETPOINT, 2000), (COMMAND, FORWARD)]
    drive.run(reverse=True)
    line.advance(30.0)
    assert line.drive(1).state == "reverse"
    drive.stop()
    assert written(line)[2:] == [(COMMAND, REVERSE), (COMMAND, STOP)]
    assert line.drive(1).state == "stopped"


def test_a_trip_is_told_by_its_bit_and_reset(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(2)
    status = drive.status()
    assert status.state is State.FAULT
    assert status.fault is not None
    assert (status.fault.code, status.fault.mnemonic) == (2, "OV")
    drive.reset_fault()
    assert written(line) == [(COMMAND, RESET)]
    assert drive.status().state is State.STOPPED


def test_it_is_known_by_its_answers_and_nothing_is_asked_that_harms_a_huanyang(line: Simulator, bus: Bus) -> None:
    found = bus.identify(1)
    assert (found.family, found.certainty) == ("starvert", "by answers")
    asked = [data for _, who, data in line.line.trace() if who == "master"]
    own = [data for data in asked if data[1] == 0x04]
    assert [data[2:4].hex() for data in own] == ["0000", "000e"]


@pytest.mark.parametrize("other", [name for name in drivebus.profiles() if name != "starvert"])
def test_no_drive_of_another_family_gets_its_words(other: str) -> None:
    """0005H starts a V20 (START), turns others round and is a parameter of many, kept in EEPROM."""
    with Simulator({1: other}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "starvert", unverified=True)
        whats: list[Callable[[], object]] = [
            drive.stop,
            lambda: drive.run(10.0),
            lambda: drive.write("parameter_lock", 1),
            drive.reset_fault,
        ]
        for what in whats:
            with suppress(DrivebusError):
                what()
        machine = line.drive(1)
        assert machine.eeprom_writes == 0
        assert machine.state in ("stopped", "running")
        if other != "huanyang-hy":
            # That one speaks no Modbus, and takes no notice of a word.
            assert not {place for place, _ in written_by_any(line)} & {0x0003, SETPOINT, COMMAND}


def written_by_any(line: Simulator) -> list[tuple[int, int]]:
    frames = [data for _, who, data in line.line.trace() if who == "master" and data[1] in (0x06, 0x10)]
    return [(int.from_bytes(data[2:4], "big"), int.from_bytes(data[-4:-2], "big")) for data in frames]


def test_nothing_moves_by_what_is_printed_alone(line: Simulator, bus: Bus) -> None:
    """The page with the bits is at hand for a sister."""
    for job in (lambda drive: drive.run(20.0), Drive.run, Drive.stop, Drive.reset_fault):
        with pytest.raises(NotAllowed, match="not verified"):
            job(bus.drive(1, "starvert"))
    assert written(line) == []


def test_a_locked_one_says_what_unlocks_it(line: Simulator, drive: Drive) -> None:
    """SV-iG5A manual (easymanua.ls lsis sv-ig5a), p. 11-3: 14H while 0004H is 0."""
    line.drive(1).refuse(0x14, asked="writes")
    with pytest.raises(DrivebusError, match="parameter_lock is 0"):
        drive.run()


def test_eight_words_go_in_a_request() -> None:
    profile = Profile.builtin("starvert")
    assert (profile.max_words, profile.title) == (8, "LS Starvert and LSLV")
