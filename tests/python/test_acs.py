"""An ABB ACS355 by the ABB drives profile: 0476H before each run from rest, and no run in reverse.

ACS355 user's manual (easymanua.ls abb acs355), pp. 313 and 319: the control word is register 40001, REF1 40002, the
status word 40004. The frames are written by hand, their CRCs computed with the bit-by-bit loop of *Modbus over Serial
Line* V1.02, section 6.2.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivebus import Bus, Drive, NotAllowed, Simulator, State, Unconfirmed

from .jobs import asked, carry_out_awaited

READY = "01 06 00 00 04 76 0A EC"
FORWARD_10_OF_50_HZ = "01 10 00 00 00 02 04 04 7F 0F A0 C6 CF"
FORWARD_10_OF_60_HZ = "01 10 00 00 00 02 04 04 7F 0D 05 07 D4"
STOP = "01 06 00 00 04 7E 0B 2A"
COAST = "01 06 00 00 04 7C 8A EB"
RESET = "01 06 00 00 04 F6 0B 4C"
READ_STATUS = "01 03 00 03 00 01 74 0A"
READ_FAULT = "01 03 01 90 00 01 85 DB"
LOOK = [READ_STATUS, READ_FAULT]
"""0401, the last fault, counts while the status word says that it has tripped."""


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "acs355"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, "acs355", unverified=True)
        drive.prepare_control(store=True)
        yield drive


def commanded(line: Simulator) -> list[str]:
    """What was written to the control word, alone or with REF1."""
    return [frame for frame in asked(line) if frame.startswith(("01 06 00 00", "01 10 00 00"))]


def test_a_start_is_these_bytes_and_no_others(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    sent = asked(line)
    assert sent[sent.index(READY) :] == [READY, *LOOK, FORWARD_10_OF_50_HZ, *LOOK]
    assert drive.state() is State.FORWARD
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)


def test_the_setpoint_is_a_share_of_parameter_1105(line: Simulator, drive: Drive) -> None:
    drive.write("1105", 60.0, store=True)
    drive.run(10.0)
    assert commanded(line) == [READY, FORWARD_10_OF_60_HZ]
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)


def test_no_run_is_reversed(line: Simulator, drive: Drive) -> None:
    """No bit of the control word reverses, and a negative REF1 is not sent."""
    with pytest.raises(NotAllowed, match="no command run_reverse"):
        drive.run(10.0, reverse=True)
    assert commanded(line) == []


def test_without_the_callers_word_nothing_is_started(line: Simulator) -> None:
    with Bus(line) as bus, pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "acs355").run(10.0)
    assert commanded(line) == []


def test_the_drive_obeys_no_run_without_0476h(line: Simulator, drive: Drive) -> None:
    drive.write_words(0x0000, 0x047F)
    assert line.drive(1).state == "stopped"
    drive.write_words(0x0000, 0x0476)
    drive.write_words(0x0000, 0x047F)
    assert line.drive(1).state == "forward"


def test_a_drive_whose_switching_on_is_inhibited_gets_no_run(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus: Any = drive.bus
    read = bus.read_stamped

    def inhibited(unit: int, address: int, count: int = 1, /, **how: Any) -> tuple[list[int], float, float]:
        words, asked, answered = read(unit, address, count, **how)
        return ([0x0270] if address == 0x0003 else words), asked, answered

    monkeypatch.setattr(bus, "read_stamped", inhibited)
    with pytest.raises(Unconfirmed, match=r"\(0476H\) was sent, once, .*switch_on_inhibited on and not off"):
        drive.run(10.0)
    assert commanded(line) == [READY]


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    return [
        lambda: drive.prepare_control(store=True),
        lambda: drive.run(10.0),
        lambda: drive.wait_for_speed(10.0, timeout=100),
        lambda: line.drive(1).trip(7),
        drive.reset_fault,
        lambda: drive.run(10.0),
        drive.coast,
        lambda: line.advance(100.0),
        lambda: drive.run(10.0),
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=100),
    ]


WHOLE = [READY, FORWARD_10_OF_50_HZ, RESET, READY, FORWARD_10_OF_50_HZ, COAST, READY, FORWARD_10_OF_50_HZ, STOP]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert commanded(line) == WHOLE


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "acs355", program)
    assert commanded(line) == WHOLE
