"""WEG CFW500: the words of a program that runs a real one and of a CFW-11's manual, and how it stands beside an ACS355.

cfw500_modbus.py (class CFW500Modbus); CFW-11 serial communication manual (WEG 0899.5741).
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivebus import Bus, Drive, NotAllowed, Refused, Simulator, State


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "cfw500"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "cfw500", unverified=True)


def sent(line: Simulator) -> list[tuple[int, int]]:
    return [(place, word) for _, place, word in line.drive(1).take_writes()]


def test_it_runs_and_stops_by_the_words_of_the_program(line: Simulator, drive: Drive) -> None:
    """7 and 2 at 682; half of P0403, which is 50 Hz here, is 4096 of 8192 counts at 683."""
    drive.run(25.0)
    assert line.drive(1).state == "forward"
    drive.stop()
    assert line.drive(1).state == "stopped"
    assert sorted(sent(line)) == [(682, 2), (682, 7), (683, 4096)]


def test_it_coasts_without_the_enable(line: Simulator, drive: Drive) -> None:
    drive.run(25.0)
    drive.coast()
    assert sent(line)[-1] == (682, 0)


def test_a_stop_is_proved_by_its_frequency(line: Simulator, drive: Drive) -> None:
    """Nobody prints what P0680 is while the motor coasts."""
    drive.run(25.0)
    drive.stop()
    asked = [data[2:4].hex() for _, who, data in line.line.trace() if who == "master" and data[1] == 0x03]
    assert "0005" in asked[-4:]


def test_it_does_not_run_without_unverified(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "cfw500")
        with pytest.raises(NotAllowed):
            drive.run(20.0)
    assert sent(line) == []


def test_it_is_run_in_reverse_by_3(line: Simulator, drive: Drive) -> None:
    """Bit 2 is the direction; bit 10 of P0680 tells it."""
    drive.run(25.0, reverse=True)
    assert line.drive(1).state == "reverse"
    assert drive.status().state is State.REVERSE
    assert (682, 3) in sent(line)


def test_a_fault_is_told_by_its_number_and_reset_by_bit_7(line: Simulator, drive: Drive) -> None:
    """Bit 15 of P0680, and P0049; 128 resets it."""
    line.drive(1).trip(228)
    status = drive.status()
    assert status.state is State.FAULT
    assert status.fault is not None
    assert (status.fault.code, status.fault.mnemonic) == (228, "F228")
    drive.reset_fault()
    assert sent(line)[-1] == (682, 0x80)
    assert drive.status().state is State.STOPPED


def test_it_is_known_by_its_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == ("cfw500", "by answers")


@pytest.mark.parametrize(("named", "unit"), [("acs355", "cfw500"), ("acs580", "cfw500"), ("cfw500", "acs355")])
def test_by_the_name_of_an_acs355_it_gets_nothing_that_moves(named: str, unit: str) -> None:
    """Both have 0000H, 0003H and 0066H; an ACS355 has no parameter 0681."""
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, named, unverified=True, variants={"base_frequency": "50 Hz"})
        with pytest.raises((NotAllowed, Refused)):
            drive.run(20.0)
        assert line.drive(1).state == "stopped"
        assert line.drive(1).eeprom_writes == 0
        assert all(place not in (682, 683) for place, _ in sent(line))
