"""A Siemens SINAMICS V20: 047EH goes before each run from rest, and the sense of bit 11 is the maker's.

The bits are those of the SINAMICS G120C manual (easymanua.ls siemens sinamics-g120c-dp, p. 235): bit 0 on, bits 1 and
2 no OFF2 and no OFF3, bit 7 acknowledges, bit 10 from the bus, bit 11 reverses. Registers: FluidNC,
SiemensV20Protocol.cpp. The frames are written by hand, their CRCs computed with the bit-by-bit loop of *Modbus over
Serial Line* V1.02, section 6.2.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from click.testing import CliRunner

from drivebus import Bus, Drive, NotAllowed, Profile, Simulator, State, Unconfirmed
from drivebus.cli import cli

from .jobs import asked, carry_out_awaited

OFF = "01 06 00 63 04 7E FB 34"
FORWARD_10_OF_50_HZ = "01 10 00 63 00 02 04 04 7F 0C CD 41 EF"
REVERSE_10_OF_50_HZ = "01 10 00 63 00 02 04 0C 7F 0C CD 43 8F"
FORWARD_10_OF_60_HZ = "01 10 00 63 00 02 04 04 7F 0A AB C2 65"
COAST = "01 06 00 63 04 7C 7A F5"
RESET = "01 06 00 63 04 FE FA 94"
READ_STATUS = "01 03 00 6D 00 01 15 D7"


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "v20"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "v20", unverified=True)


def written(line: Simulator) -> list[str]:
    return [frame for frame in asked(line) if frame[3:5] in ("06", "10")]


def test_a_start_is_these_bytes_and_no_others(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    sent = asked(line)
    first = sent.index(OFF)
    assert sent[first:] == [OFF, READ_STATUS, FORWARD_10_OF_50_HZ, READ_STATUS]
    assert written(line) == [OFF, FORWARD_10_OF_50_HZ]
    assert drive.state() is State.FORWARD
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)


def test_bit_11_reverses(line: Simulator, drive: Drive) -> None:
    drive.run(10.0, reverse=True)
    assert written(line) == [OFF, REVERSE_10_OF_50_HZ]
    assert drive.state() is State.REVERSE
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(-10.0, abs=0.01)


def test_the_setpoint_is_a_share_of_p2000(line: Simulator, drive: Drive) -> None:
    drive.write("P2000", 60.0, store=True)
    before = len(written(line))
    drive.run(10.0)
    assert written(line)[before:] == [OFF, FORWARD_10_OF_60_HZ]
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)


@pytest.mark.parametrize(
    ("reference", "counts"),
    # 163840 by 55 are 2978.9, by 87 1883.2, by 47.53 3447.1, by 400 409.6.
    [(55.0, 2979), (87.0, 1883), (47.53, 3447), (400.0, 410)],
)
def test_10_hz_are_a_share_of_what_p2000_says(line: Simulator, drive: Drive, reference: float, counts: int) -> None:
    drive.write("P2000", reference, store=True)
    drive.run(10.0)
    assert (line.drive(1).register(0x0064), line.drive(1).state) == (counts, "forward")
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0, abs=reference / 16384)


def test_a_reference_that_is_none_is_refused(line: Simulator, drive: Drive) -> None:
    drive.write("P2000", 590.0, store=True)
    before = len(written(line))
    with pytest.raises(NotAllowed, match=r"P2000 of unit 1 is 59000, which means nothing known.*'1 Hz' to '550 Hz'"):
        drive.run(10.0)
    with pytest.raises(NotAllowed, match="P2000"):
        drive.setpoint = 10.0
    assert len(written(line)) == before
    with Bus(line) as bus:
        for wrong in ("0.5 Hz", "551 Hz", "50.001 Hz", "fast"):
            with pytest.raises(NotAllowed, match="1 Hz to 550 Hz, in its own steps"):
                bus.drive(1, "v20", variants={"base_frequency": wrong}, unverified=True)
        drive = bus.drive(1, "v20", variants={"base_frequency": "87"}, unverified=True)
        assert drive.profile.variants_chosen == {"base_frequency": "87 Hz"}


def test_who_said_what_it_is_a_share_of_does_not_set_it_otherwise(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "v20", variants={"base_frequency": "50 Hz"}, unverified=True)
        drive.write("P2000", 50.0, store=True)
        with pytest.raises(NotAllowed, match="base_frequency"):
            drive.write("P2000", 60.0, store=True)
        assert drive.read("P2000") == 50.0


def test_the_command_says_between_what_it_may_be() -> None:
    told = CliRunner().invoke(cli, ["profiles", "show", "v20"]).output
    assert "what P2000 says, 1 Hz to 550 Hz" in told
    assert '--variant base_frequency="550 Hz"' in told


def test_the_drive_obeys_no_run_without_047eh(line: Simulator, drive: Drive) -> None:
    for words in ([0x047F], [0x047E, 0x047C, 0x047F], [0x047E, 0x04FE, 0x047F]):
        for word in words:
            drive.write_words(0x0063, word)
        assert line.drive(1).state == "stopped", words
    drive.write_words(0x0063, 0x047E)
    drive.write_words(0x0063, 0x047F)
    assert line.drive(1).state == "forward"


def test_a_drive_whose_switching_on_is_inhibited_gets_no_run(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus: Any = drive.bus
    read = bus.read_stamped

    def inhibited(unit: int, address: int, count: int = 1, /, **how: Any) -> tuple[list[int], float, float]:
        words, asked, answered = read(unit, address, count, **how)
        return ([0x0270] if address == 0x006D else words), asked, answered

    monkeypatch.setattr(bus, "read_stamped", inhibited)
    with pytest.raises(Unconfirmed, match=r"off \(047EH\) was sent, once, .*switch_on_inhibited on and not off"):
        drive.run(10.0)
    assert written(line) == [OFF]


def test_single_bits_are_not_written_by_name(line: Simulator, drive: Drive) -> None:
    """0005H is bit 0 of the control word: it starts the motor as 0063H does."""
    for name in ("start", "run_enable", "direction", "fault_acknowledgement"):
        with pytest.raises(NotAllowed, match="can move the motor"):
            drive.write(name, 1)
    assert written(line) == []
    assert Profile.builtin("v20").is_command(0x0005)


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    machine = line.drive(1)
    return [
        lambda: drive.run(10.0),
        lambda: drive.wait_for_speed(10.0, timeout=100),
        lambda: machine.trip(7),
        drive.reset_fault,
        lambda: drive.run(10.0),
        drive.coast,
        lambda: line.advance(100.0),
        lambda: drive.run(10.0, reverse=True),
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=100),
    ]


WHOLE = [OFF, FORWARD_10_OF_50_HZ, RESET, OFF, FORWARD_10_OF_50_HZ, COAST, OFF, REVERSE_10_OF_50_HZ, OFF]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert written(line) == WHOLE


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "v20", program)
    assert written(line) == WHOLE


def test_the_command_waits_for_the_speed_that_it_gave() -> None:
    """No register tells the setpoint in force, so a start without one has nothing to wait for."""
    words = [
        "--port",
        "sim://v20?clock=virtual",
        "--profile",
        "v20",
        "--unverified",
        "--variant",
        "base_frequency=50 Hz",
    ]
    done = CliRunner().invoke(cli, [*words, "run", "10", "--yes", "--wait", "60"])
    assert (done.exit_code, "forward" in done.stdout) == (0, True), done.output
    refused = CliRunner().invoke(cli, [*words, "run", "--yes", "--wait", "60"])
    assert refused.exit_code == 2
    assert "does not tell its setpoint" in refused.output
    assert "Nothing was sent" in refused.output
