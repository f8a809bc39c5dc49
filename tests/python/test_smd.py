"""Lenze AC Tech SMD: refuses whatever is written to it, a stop too, until 0 has been written to register 48.

RG-SDMOD (Lenze AC Tech, smd series drives, Modbus communications reference guide), by its printed pages: the lock,
p. 10; register 1, p. 13; registers 24 to 29, p. 15; what 69 at register 19 says, p. 6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from drivebus import Bus, Drive, DrivebusError, NotAllowed, Profile, Refused, Simulator, State

UNLOCK, FORWARD, REVERSE, START, STOP, LOCK = (48, 0), (1, 128), (1, 64), (1, 8), (1, 4), (1, 2)
SETPOINT = 40


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "smd"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def bus(line: Simulator) -> Iterator[Bus]:
    with Bus(line) as bus:
        # Before that, a refusal may be the answer to another program.
        bus.sleep(1.5)
        yield bus


@pytest.fixture
def drive(bus: Bus) -> Drive:
    return bus.drive(1, "smd", unverified=True)


def tried(line: Simulator) -> list[tuple[int, int]]:
    """What was to be written so far, taken or refused."""
    frames = [data for _, who, data in line.line.trace() if who == "master" and data[1] == 0x06]
    return [(int.from_bytes(data[2:4], "big"), int.from_bytes(data[4:6], "big")) for data in frames]


def test_a_run_comes_after_the_word_that_unlocks_it_and_is_sent_once(line: Simulator, drive: Drive) -> None:
    drive.run(20.0)
    assert line.drive(1).state == "forward"
    assert tried(line) == [UNLOCK, (SETPOINT, 200), UNLOCK, FORWARD, UNLOCK, START]
    assert drive.status().state is State.RUNNING


def test_a_reverse_run_is_told_by_the_word_before(line: Simulator, drive: Drive) -> None:
    drive.run(20.0, reverse=True)
    assert line.drive(1).state == "reverse"
    drive.run()
    line.advance(30.0)
    assert line.drive(1).state == "forward"
    assert [word for place, word in tried(line) if place == 1] == [64, 8, 128, 8]


def test_a_motor_that_the_bus_runs_is_halted_by_one_word(line: Simulator, drive: Drive) -> None:
    drive.run(20.0)
    before = tried(line)
    drive.stop()
    assert tried(line) == [*before, STOP]
    assert line.drive(1).state == "stopped"


@pytest.mark.parametrize("lock", ["by a word", "by its power"])
def test_a_stop_of_a_drive_that_locked_itself_is_sent_again(line: Simulator, bus: Bus, drive: Drive, lock: str) -> None:
    """It answers 01 (p. 10), which says that nothing came of it."""
    drive.run(20.0)
    if lock == "by a word":
        bus.write(1, *LOCK)
    else:
        line.drive(1).power_cycle()
    before = tried(line)
    drive.stop()
    assert tried(line) == [*before, STOP, UNLOCK, STOP]
    assert line.drive(1).state == "stopped"


def test_a_stop_on_a_line_just_opened_unlocks_it_before_the_second(line: Simulator) -> None:
    """There the refusal may be the answer to another program: nobody heeds it."""
    with Bus(line) as bus:
        bus.drive(1, "smd").stop()
        assert tried(line) == [STOP, UNLOCK, STOP]
        assert line.now() < 0.5


def test_a_setpoint_is_sent_again_once_it_is_locked(line: Simulator, bus: Bus, drive: Drive) -> None:
    drive.setpoint = 20.0
    bus.write(1, *LOCK)
    drive.setpoint = 30.0
    assert tried(line) == [UNLOCK, (SETPOINT, 200), LOCK, (SETPOINT, 300), UNLOCK, (SETPOINT, 300)]


def test_a_start_that_cannot_be_unlocked_is_not_sent(line: Simulator, bus: Bus, drive: Drive) -> None:
    """C01 is neither 10 nor 11 (p. 10)."""
    drive.setpoint = 20.0
    bus.write(1, *LOCK)
    before = tried(line)
    line.drive(1).refuse(0x01, asked="writes")
    with pytest.raises(Refused, match="C01 is 10 or 11"):
        drive.run()
    assert tried(line) == [*before, UNLOCK]
    with pytest.raises(Refused):
        drive.stop(within=0.3)
    assert set(tried(line)[len(before) + 1 :]) == {STOP, UNLOCK}
    line.drive(1).refuse_no_more()
    drive.stop()
    assert line.drive(1).state == "stopped"


@pytest.mark.parametrize("other", ["gd350", "e510", "h100", "frenic", "acs355", "cfw500", "optidrive-e3", "v20"])
@pytest.mark.parametrize("trusted", [False, True])
def test_no_drive_of_another_family_gets_the_word_that_unlocks(other: str, trusted: bool) -> None:
    """0030H may be a parameter, kept in EEPROM. Who means the name all the same sets by it what else they write."""
    with Simulator({1: other}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "smd", unverified=True, trust_profile=trusted)
        whats: list[Callable[[], object]] = [
            drive.stop,
            drive.run,
            lambda: drive.write("speed_command", 20.0),
            drive.stop,
        ]
        for what in whats:
            with suppress(DrivebusError):
                what()
        assert 48 not in {place for place, _ in tried(line)}
        assert trusted or line.drive(1).eeprom_writes == 0


def test_what_is_locked_can_be_read(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(5)
    status = drive.status()
    assert (status.state, status.fault.code if status.fault else 0) == (State.FAULT, 5)
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run()
    assert tried(line) == []


def test_it_is_known_by_its_answers(bus: Bus) -> None:
    found = bus.identify(1)
    assert (found.family, found.certainty) == ("smd", "by answers")


def test_no_frequency_goes_out_without_unverified(line: Simulator, bus: Bus) -> None:
    """The range of register 40 is that of another series."""
    plain = bus.drive(1, "smd")
    with pytest.raises(NotAllowed, match="unverified"):
        plain.run(20.0)
    assert tried(line) == []
    plain.run()
    assert tried(line) == [UNLOCK, FORWARD, UNLOCK, START]
    plain.stop()


def test_one_word_goes_in_a_request() -> None:
    assert Profile.builtin("smd").max_words == 1
