"""A Danfoss FC 51: whole control words, a reference in shares of 4000H, and a status word of bits.

Bytes are typed by hand from the bits of the control word (operating instructions MG.02.A4.02, p. 28) and from the
registers 50000, 50010 and 50200 (design guide, manualshive 3813217, p. 81), less one on the wire: C34FH, C359H, C417H.
10 Hz of 50 Hz are 16384 / 5 = 3276.8 counts: 3277 are 0CCDH.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import drivebus
from drivebus import Bus, Drive, NotAllowed, Simulator, State

REFERENCE = "01 06 C3 59 0C CD"
RUN = "01 06 C3 4F 04 7C"
STOP = "01 06 C3 4F 04 3C"
COAST = "01 06 C3 4F 04 34"
RESET = "01 06 C3 4F 04 BC"


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "fc51"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "fc51", unverified=True)


def sent(line: Simulator, function: int = 0x06) -> list[str]:
    """The requests of one function, without their CRCs."""
    frames = [data for _, who, data in line.line.trace() if who == "master"]
    return [frame[:-2].hex(" ").upper() for frame in frames if frame[1] == function]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    simulated = line.drive(1)
    assert drive.prepare_control() is not None
    drive.run(hz=10.0)
    reached = drive.wait_for_speed(timeout=30)
    assert (reached.state, reached.frequency) == (State.FORWARD, 10.0)
    assert drive.setpoint == 10.001  # 3277 / 16384 of 50
    seen = drive.monitor()
    assert (seen["running_frequency"], seen["reference"], seen["main_actual_value"]) == (10.0, 10.001, 20.001)
    assert 0.0 < seen["output_current"] < 10.0
    simulated.trip(4)
    assert drive.state() is State.FAULT
    drive.reset_fault()
    assert drive.state() is State.STOPPED
    drive.run(hz=10.0)
    drive.wait_for_speed(timeout=30)
    drive.coast()
    assert (drive.state(), simulated.frequency) == (State.STOPPED, 0.0)
    line.advance(60.0)
    drive.run()
    drive.stop()
    drive.wait_until_stopped(timeout=30)
    # Command and reference are ten registers apart, so they are two requests, and the reference comes first.
    assert sent(line) == [REFERENCE, RUN, RESET, REFERENCE, RUN, COAST, RUN, STOP]
    assert sent(line, 0x10) == []
    assert (simulated.state, simulated.speed) == ("stopped", 0.0)


def test_what_100_percent_are_is_asked_of_the_drive(line: Simulator, drive: Drive) -> None:
    drive.setpoint = 50
    # 3-03 takes two words, 0BD5H and the one behind it, the high one first.
    assert "01 03 0B D5 00 02" in sent(line, 0x03)
    assert sent(line) == ["01 06 C3 59 40 00"]
    assert drive.read("3-03") == 50.0
    with pytest.raises(NotAllowed, match=r"allowed is 0.000 to 50.000 Hz"):
        drive.run(hz=50.1)


def test_who_says_it_is_not_asked(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "fc51", variants={"base_frequency": "60 Hz"}, unverified=True)
        drive.setpoint = 30
    assert sent(line) == ["01 06 C3 59 20 00"]
    assert "01 03 0B D5 00 02" not in sent(line, 0x03)


def test_100_percent_may_be_any_frequency(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "fc51", variants={"base_frequency": "87 Hz"}, unverified=True)
        drive.setpoint = 30
        with pytest.raises(NotAllowed, match="1 Hz to 400 Hz"):
            bus.drive(1, "fc51", variants={"base_frequency": "1500 Hz"}, unverified=True)
    # 491520 by 87 are 5649.7: 1612H.
    assert sent(line) == ["01 06 C3 59 16 12"]


def test_without_a_word_of_trust_it_gets_no_speed(line: Simulator) -> None:
    """Its own pages print registers and bits (design guide, manualshive 3813217, p. 81), and not what 100 % are."""
    with Bus(line) as bus:
        drive = bus.drive(1, "fc51")
        with pytest.raises(NotAllowed, match="unverified=True"):
            drive.run(hz=10.0)
        assert sent(line) == []
        drive.run()
        drive.stop()
        drive.coast()
        assert drive.state() is State.STOPPED
    assert sent(line) == [RUN, STOP, COAST]


def test_what_its_status_word_cannot_tell_is_no_command(line: Simulator, drive: Drive) -> None:
    """It has no bit for the direction: a motor in reverse would look like one that turns forward."""
    with pytest.raises(NotAllowed, match="run_reverse"):
        drive.run(hz=10.0, reverse=True)
    with pytest.raises(NotAllowed, match="jog_forward"):
        drive.jog()
    assert sent(line) == []


def test_raw_words_are_held_to_its_control_words(line: Simulator) -> None:
    """The high bit of C34FH tells nothing of a memory."""
    with Bus(line) as bus:
        bus.drive(1, "fc51")
        for word in (1, 6, 0x047F):
            with pytest.raises(NotAllowed, match="is not a command of unit 1, which is known as Danfoss"):
                bus.write(1, 0xC34F, word)
        bus.write(1, 0xC34F, 0x847C)
        # 2000H is the command register of others.
        with pytest.raises(NotAllowed, match="2000H is the command register of"):
            bus.write(1, 0x2000, 1)
    assert sent(line) == ["01 06 C3 4F 84 7C"]


def test_a_control_word_for_it_does_not_go_to_another() -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.drive(1, "gd350")
        with pytest.raises(NotAllowed, match="C34FH is the command register of Danfoss"):
            bus.write(1, 0xC34F, 0x047C)


def test_a_second_reset_needs_the_bit_to_rise_again(line: Simulator, drive: Drive) -> None:
    simulated = line.drive(1)
    simulated.trip(4)
    drive.reset_fault()
    simulated.trip(4)
    with pytest.raises(drivebus.Unconfirmed):
        drive.reset_fault()
    drive.stop(confirm=0)
    drive.reset_fault()
    assert drive.state() is State.STOPPED
    assert sent(line) == [RESET, RESET, STOP, RESET]


def test_it_is_known_by_what_it_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.certainty, found.candidates) == ("by answers", ("fc51",))


def test_a_value_of_two_words_goes_by_one_request_the_high_one_first(line: Simulator, drive: Drive) -> None:
    """3-42 is at 0D5BH (MG.02.A4.02, p. 34). 700 s are 70000 hundredths, 00011170H."""
    for seconds, words in ((20.5, "00 00 08 02"), (700.0, "00 01 11 70"), (20.5, "00 00 08 02")):
        drive.write("3-42", seconds, store=True)
        assert sent(line, 0x10)[-1] == f"01 10 0D 5B 00 02 04 {words}"
        assert drive.read("3-42") == seconds
    # What it has already is not stored once more.
    drive.write("3-42", 20.5, store=True)
    assert len(sent(line, 0x10)) == 3
    with pytest.raises(NotAllowed, match=r"out of range, allowed is 0.00 to 42949672.95 s"):
        drive.write("3-42", 5e7, store=True)
    with pytest.raises(NotAllowed, match=r"finer than the drive counts; the nearest allowed are 0.00 and 0.01 s"):
        drive.write("3-42", 0.001, store=True)
    drive.prepare_control()
    drive.run(hz=5.0)
    with pytest.raises(NotAllowed, match="only while the drive is stopped"):
        drive.write("3-42", 30, store=True)
    drive.stop()
    drive.wait_until_stopped(timeout=30)
    assert len(sent(line, 0x10)) == 3
    # A restore does not write it, and says so.
    saved = drive.backup()
    drive.write("3-42", 10.0, store=True)
    drive.restore(saved)
    assert drive.read("3-42") == 10.0
