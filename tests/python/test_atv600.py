"""A Schneider Altivar 600, such as an Altivar 630: the words of an Altivar 312, forward only, and only with CHCF = 1.

The maker's list of its parameters (EAV64332, V3.7): CMD at 8501 and ETA at 3201 have the bits of CiA 402, and no bit of
CMD is the direction. With CHCF = 3, the I/O profile, bit 0 of the same register runs the motor. LFt at 7121 is the
fault. That it is told from an Altivar 12 and an Altivar 312 before a write is in `test_atv12`. The frames are those of
`test_atv`.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivebus import BadArgument, Bus, Drive, NotAllowed, Profile, Simulator, State

from .jobs import asked
from .test_atv import COAST, FORWARD_10_HZ, READ_ETA, RESET, SHUTDOWN, STOP, SWITCH_ON, from_first_write, written

CHCF, FR1, CMI, LFT = 8401, 8413, 8504, 7121
READ_LFT = "01 03 1B D1 00 01 D2 D7"


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "atv600"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, "atv600")
        drive.prepare_control(store=True)
        yield drive


def test_a_start_is_these_bytes_and_no_others(line: Simulator, drive: Drive) -> None:
    assert [(at, word) for _, at, word in line.drive(1).writes()] == [(FR1, 164), (CMI, 2)]
    before = len(asked(line))
    drive.run(10.0)
    look = [READ_ETA, READ_LFT]
    assert from_first_write(asked(line)[before:]) == [SHUTDOWN, *look, SWITCH_ON, *look, FORWARD_10_HZ, *look]
    assert drive.state() is State.FORWARD
    line.advance(60.0)
    assert line.drive(1).frequency == pytest.approx(10.0)


def test_it_stops_coasts_and_resets(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    line.advance(20.0)
    drive.stop()
    drive.wait_until_stopped(timeout=30.0)
    drive.run(10.0)
    line.advance(20.0)
    # DOTD may make a ramp of it.
    with pytest.raises(NotAllowed, match="coast of Schneider Altivar 600 is not verified"):
        drive.coast()
    assert isinstance(drive.bus, Bus)
    drive.bus.drive(1, "atv600", unverified=True).coast()
    line.advance(60.0)
    line.drive(1).trip(17)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (17, "OLF")
    drive.reset_fault()
    assert (drive.fault(), drive.bus.read(1, LFT)) == (None, [17])
    start = [SHUTDOWN, SWITCH_ON, FORWARD_10_HZ]
    assert written(line) == [*start, STOP, *start, COAST, RESET]


def test_it_has_no_word_for_the_other_direction(line: Simulator, drive: Drive) -> None:
    with pytest.raises(BadArgument, match="no command run_reverse"):
        drive.run(10.0, reverse=True)
    assert written(line) == []
    assert 0x080F not in Profile.builtin("atv600").command_registers()[8501]


@pytest.mark.parametrize(("mode", "hz"), [(2, 10.0), (3, 10.0), (3, None)])
def test_in_another_profile_nothing_is_started_and_nothing_set(
    line: Simulator, drive: Drive, mode: int, hz: float | None
) -> None:
    drive.bus.write(1, CHCF, mode)
    before = len(line.drive(1).writes())
    with pytest.raises(NotAllowed, match=rf"CHCF .*: {mode}, needs 1"):
        drive.run(hz)
    with pytest.raises(NotAllowed, match=rf"CHCF of unit 1 is {mode}, and must be 1"):
        drive.prepare_control(store=True)
    assert len(line.drive(1).writes()) == before


def test_what_stands_on_it_leads_to_its_profile() -> None:
    for said in ("ATV630", "altivar 630", "Altivar 600", "Schneider Altivar 600"):
        assert Profile.builtin(said).name == "atv600"
