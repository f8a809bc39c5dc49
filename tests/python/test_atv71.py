"""A Schneider Altivar 71, and an Altivar 61: the words of an Altivar 312, behind a setpoint, and only with CHCF = 1.

The maker's manuals of communication parameters (AAV49428) and of integrated Modbus (1755863): CMD at 8501 and ETA at
3201, 0FH forward and 080FH in reverse (pp. 25 to 30). No run is obeyed before a setpoint came (pp. 26 and 62). DOTD
says how it stops (p. 26). LFt at 7121 is the fault. With CHCF = 3, the I/O profile, bit 0 of CMD runs the motor, which
is in `test_other_words`; that it is told from the other Altivars before a write is in `test_atv12`. The frames are
those of `test_atv`.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivebus import BadArgument, Bus, Drive, NotAllowed, Profile, Refused, Simulator, State, Unconfirmed

from .jobs import asked
from .test_atv import (
    COAST,
    FORWARD,
    FORWARD_10_HZ,
    READ_ETA,
    RESET,
    REVERSE_10_HZ,
    SHUTDOWN,
    STOP,
    SWITCH_ON,
    from_first_write,
    written,
)

CMD, LFR, CMI, ETA, LFT, CHCF, FR1, DOTD, HSP = 8501, 8502, 8504, 3201, 7121, 8401, 8413, 8652, 3104
READ_LFT = "01 03 1B D1 00 01 D2 D7"
START = [SHUTDOWN, SWITCH_ON, FORWARD_10_HZ]


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "atv71"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, "atv71")
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


def test_it_turns_the_other_way_stops_coasts_and_resets(line: Simulator, drive: Drive) -> None:
    drive.run(10.0, reverse=True)
    line.advance(20.0)
    assert drive.state() is State.REVERSE
    assert line.drive(1).frequency == pytest.approx(-10.0)
    drive.stop()
    drive.wait_until_stopped(timeout=30.0)
    drive.run(10.0)
    line.advance(20.0)
    drive.coast()
    line.advance(60.0)
    line.drive(1).trip(17)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (17, "OLF")
    drive.reset_fault()
    assert (drive.fault(), drive.bus.read(1, LFT)) == (None, [17])
    assert written(line) == [SHUTDOWN, SWITCH_ON, REVERSE_10_HZ, STOP, *START, COAST, RESET]


def test_a_run_without_a_setpoint_waits_for_one_until_it_is_stopped(line: Simulator, drive: Drive) -> None:
    with pytest.raises(Unconfirmed):
        drive.run()
    assert line.drive(1).state == "stopped"
    assert written(line) == [SHUTDOWN, SWITCH_ON, FORWARD]
    drive.stop()
    drive.setpoint = 10.0
    line.advance(5.0)
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    drive.run()
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0)


def test_the_simulated_drive_starts_when_the_setpoint_comes(line: Simulator, drive: Drive) -> None:
    """AAV49428, p. 62: without a reference it does not proceed to operation enabled, even if the command is sent."""
    for word, shown in ((6, 0x0231), (7, 0x0233), (15, 0x0233)):
        drive.bus.write(1, CMD, word)
        line.advance(1.0)
        assert drive.bus.read(1, ETA) == [shown]
    drive.bus.write(1, LFR, 100)
    line.advance(1.0)
    assert drive.bus.read(1, ETA)[0] & 0x006F == 0x27
    drive.bus.write(1, CMD, 0)
    line.advance(60.0)
    line.drive(1).power_cycle()
    for word in (6, 7, 15):
        drive.bus.write(1, CMD, word)
    line.advance(1.0)
    assert line.drive(1).state == "stopped"


@pytest.mark.parametrize(("stop", "coasts"), [(1, False), (0, True)])
def test_how_it_stops_is_dotds_and_a_stop_waits_for_its_rest(
    line: Simulator, drive: Drive, stop: int, coasts: bool
) -> None:
    drive.write("DOTD", stop)
    drive.run(10.0)
    line.advance(20.0)
    drive.bus.write(1, CMD, 7)
    line.advance(0.1)
    # On its ramp it says that it runs (p. 26); one that coasts is switched off, and turns.
    assert (drive.bus.read(1, ETA)[0] & 0x0004 == 0) is coasts
    drive.stop()
    drive.wait_until_stopped(timeout=60.0)
    assert line.drive(1).frequency == 0.0


def test_what_is_set_is_kept_by_one_word_unless_another_bit_of_it_is_set(line: Simulator, drive: Drive) -> None:
    """CMI also stops, brakes and turns the motor (p. 85): 2 would take that back."""
    before = len(line.drive(1).writes())
    drive.write("HSP", 40.0, store=True)
    assert [(at, word) for _, at, word in line.drive(1).writes()][before:] == [(HSP, 400), (CMI, 2)]
    drive.bus.write(1, CMI, 0x1000)
    with pytest.raises(Unconfirmed, match="extended_control_word is 1000H"):
        drive.write("HSP", 45.0, store=True)
    assert (CMI, 0x1002) not in [(at, word) for _, at, word in line.drive(1).writes()]
    with pytest.raises(BadArgument, match="can move the motor"):
        drive.write("extended_control_word", 0)


def test_a_word_that_is_only_read_is_refused_as_its_manual_says(line: Simulator) -> None:
    """1755863, p. 39: 1 is written to ETA; the answer is 90H, 04H."""
    with Bus(line) as bus, pytest.raises(Refused) as refused:
        bus.write(1, ETA, 1)
    assert refused.value.code == 0x04


@pytest.mark.parametrize("mode", [0, 3])
@pytest.mark.parametrize("hz", [10.0, None])
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


def test_of_the_8_series_no_word_is_known_and_none_is_sent(line: Simulator) -> None:
    with Bus(line) as bus:
        bus.write(1, CHCF, 0)
    before = len(line.drive(1).writes())
    with Bus(line) as bus:
        drive = bus.drive(1, "atv71")
        for halt in (drive.stop, drive.coast):
            with pytest.raises(NotAllowed, match=r"CHCF of unit 1 .* is 0, .* was not sent"):
                halt()
    assert len(line.drive(1).writes()) == before


def test_what_stands_on_it_leads_to_its_profile() -> None:
    for said in ("ATV71", "atv 71", "Altivar 71", "Schneider Altivar 71", "ATV61", "Altivar 61"):
        assert Profile.builtin(said).name == "atv71"
