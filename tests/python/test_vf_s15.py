"""Toshiba VF-S15: the frames of its manual (E6581913), and what is told from it before a write.

Pages 26 and 31 (easymanua.ls toshiba tosvert-vf-s15-series); the bits are those of a program for a VF-S11 (LinuxCNC,
vfs11_vfd).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

import drivebus
from drivebus import Bus, NotAllowed, Simulator


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "vf-s15"}, transport="process", clock="virtual") as simulator:
        yield simulator


def frames(line: Simulator, *, sent: bool) -> list[str]:
    return [data.hex(" ") for _, who, data in line.line.trace() if (who == "master") is sent and data[1] & 0x7F != 0x08]


def test_a_setpoint_is_the_frame_of_the_manual(line: Simulator) -> None:
    """01 06 FA 01 17 70 E6 C6 is 60 Hz (p. 31)."""
    with Bus(line) as bus:
        bus.drive(1, "vf-s15", unverified=True).setpoint = 60.0
    assert frames(line, sent=True)[-1] == "01 06 fa 01 17 70 e6 c6"


def test_two_words_are_refused_as_in_the_manual(line: Simulator) -> None:
    """01 03 FD 00 00 02 F5 A7 is answered with 01 83 03 01 31 (p. 26)."""
    with Bus(line) as bus, pytest.raises(drivebus.Refused):
        bus.transact(1, bytes.fromhex("03 fd 00 00 02"))
    assert (frames(line, sent=True)[-1], frames(line, sent=False)[-1:]) == (
        "01 03 fd 00 00 02 f5 a7",
        ["01 83 03 01 31"],
    )


def test_a_number_that_there_is_not_is_refused_as_in_the_manual(line: Simulator) -> None:
    """01 06 FF FF 00 00 89 EE is answered with 01 86 02 C3 A1 (p. 31)."""
    with Bus(line) as bus, pytest.raises(drivebus.Refused):
        bus.transact(1, bytes.fromhex("06 ff ff 00 00"))
    assert (frames(line, sent=True)[-1], frames(line, sent=False)[-1:]) == (
        "01 06 ff ff 00 00 89 ee",
        ["01 86 02 c3 a1"],
    )


def test_nothing_moves_by_what_is_printed_alone(line: Simulator) -> None:
    with Bus(line) as bus, pytest.raises(NotAllowed):
        bus.drive(1, "vf-s15").run(20.0)
    assert line.drive(1).writes() == []


def test_it_is_known_by_its_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == ("vf-s15", "by answers")


@pytest.mark.parametrize("halt", ["stop", "coast"])
def test_a_halt_of_it_sets_no_parameter_of_an_md500(halt: str) -> None:
    """FA00H and FA01H are FA-00 and FA-01 there, in EEPROM, and FD00H answers: only FC90H tells them apart."""
    with Simulator({1: "md500"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "vf-s15", unverified=True)
        with pytest.raises(NotAllowed):
            drive.setpoint = 20.0
        with suppress(drivebus.DrivebusError):
            getattr(drive, halt)()
        assert line.drive(1).eeprom_writes == 0
        assert [place for _, place, _ in line.drive(1).writes() if place >= 0xF000] == []
