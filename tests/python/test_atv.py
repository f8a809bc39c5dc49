"""A Schneider Altivar 312: three words start it, each seen in ETA before the next, and not one of them goes out twice.

The words and states are those of its maker's manual of communication variables (BBV51701), pp. 10 to 13: 6, 7 and 15 to
CMD (8501); ETA (3201) shows 0240H, 0221H, 0223H, 0227H, with bit 9 (p. 21). 080FH runs in reverse. The frames are
written by hand, their CRCs computed with the bit-by-bit loop of *Modbus over Serial Line* V1.02, section 6.2.2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from click.testing import CliRunner

from drivebus import Bus, Drive, NotAllowed, Profile, Simulator, State, Unconfirmed
from drivebus.cli import cli

from .jobs import asked, carry_out_awaited

CMD, LFR, ETA, FR1, CMI = 8501, 8502, 3201, 8413, 8504
STORE = 2
"""Bit 1 of CMI stores all that was set (p. 20)."""

SHUTDOWN = "01 06 21 35 00 06 13 FA"
SWITCH_ON = "01 06 21 35 00 07 D2 3A"
FORWARD_10_HZ = "01 10 21 35 00 02 04 00 0F 00 64 95 3D"
REVERSE_10_HZ = "01 10 21 35 00 02 04 08 0F 00 64 97 5D"
FORWARD = "01 06 21 35 00 0F D3 FC"
REVERSE = "01 06 21 35 08 0F D4 3C"
STOP = SWITCH_ON
COAST = "01 06 21 35 00 00 93 F8"
RESET = "01 06 21 35 00 80 92 58"
READ_ETA = "01 03 0C 81 00 01 D7 72"
READ_FAULT = "01 03 21 9E 00 01 EF D8"
LOOK = [READ_ETA, READ_FAULT]


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "atv312"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    """One that obeys the bus, and was written to before: it has been asked what it is."""
    with Bus(line) as bus:
        drive = bus.drive(1, "atv312", unverified=True)
        drive.prepare_control(store=True)
        yield drive


def from_first_write(frames: list[str]) -> list[str]:
    return frames[next(at for at, frame in enumerate(frames) if frame[3:5] in ("06", "10")) :]


def written(line: Simulator) -> list[str]:
    """What was written to CMD, with the setpoint behind it."""
    return [frame for frame in asked(line) if frame[3:11] in ("06 21 35", "10 21 35")]


def test_a_start_is_these_bytes_and_no_others(line: Simulator, drive: Drive) -> None:
    before = len(asked(line))
    drive.run(10.0)
    sent = from_first_write(asked(line)[before:])
    assert sent == [SHUTDOWN, *LOOK, SWITCH_ON, *LOOK, FORWARD_10_HZ, *LOOK]
    assert drive.state() is State.FORWARD


def test_in_reverse_too(line: Simulator, drive: Drive) -> None:
    before = len(asked(line))
    drive.run(10.0, reverse=True)
    assert from_first_write(asked(line)[before:]) == [SHUTDOWN, *LOOK, SWITCH_ON, *LOOK, REVERSE_10_HZ, *LOOK]
    assert drive.state() is State.REVERSE
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(-10.0)


def test_without_a_setpoint_the_run_is_one_word(line: Simulator, drive: Drive) -> None:
    drive.setpoint = 10.0
    before = len(asked(line))
    drive.run()
    assert from_first_write(asked(line)[before:])[-3:] == [FORWARD, *LOOK]


def test_eta_shows_the_state_on_the_way(drive: Drive) -> None:
    shown = []
    for word in (0x00, 0x06, 0x07, 0x0F):
        drive.write_words(CMD, word)
        shown.append(drive.bus.read(1, ETA)[0])
    assert shown == [0x0240, 0x0221, 0x0223, 0x0227]


@pytest.mark.parametrize(
    "words", [[0x0F], [0x07, 0x0F], [0x06, 0x0F], [0x06, 0x00, 0x07, 0x0F], [0x06, 0x07, 0x06, 0x0F]]
)
def test_the_drive_obeys_no_run_out_of_its_turn(line: Simulator, drive: Drive, words: list[int]) -> None:
    for word in words:
        drive.write_words(CMD, word)
    assert line.drive(1).state == "stopped"


def test_a_drive_that_is_stuck_after_06h_gets_no_07h(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0240H: switching on is disabled, as where a terminal holds the drive."""
    held(drive.bus, monkeypatch, 0x0240)
    with pytest.raises(Unconfirmed) as error:
        drive.run(10.0)
    assert written(line) == [SHUTDOWN]
    assert line.drive(1).state == "stopped"
    told = str(error.value)
    assert told.startswith(
        "unit 1 was not started: shutdown (0006H) was sent, once, and its state word shows 0240H (stopped"
    )
    for said in ("ready_to_switch_on off and not on", "switch_on_disabled on and not off", "run forward was not sent"):
        assert said in told


def test_a_drive_that_is_stuck_after_07h_gets_no_run(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    held(drive.bus, monkeypatch, 0x0221)
    with pytest.raises(Unconfirmed, match=r"switch on \(0007H\) was sent, once, .*switched_on off and not on"):
        drive.run(10.0)
    assert written(line) == [SHUTDOWN, SWITCH_ON]


def held(bus: Any, monkeypatch: pytest.MonkeyPatch, word: int) -> None:
    """Whatever ETA shows, the bus says it is *word*."""
    read = bus.read_stamped

    def other(unit: int, address: int, count: int = 1, /, **how: Any) -> tuple[list[int], float, float]:
        words, asked, answered = read(unit, address, count, **how)
        return ([word] if address == ETA else words), asked, answered

    monkeypatch.setattr(bus, "read_stamped", other)


def behind(bus: Any, monkeypatch: pytest.MonkeyPatch, word: int, what: Callable[[], object]) -> None:
    """Does *what* when *word* was written to CMD, once."""
    write = bus.write
    done: list[bool] = []

    def watched(unit: int, address: int, value: Any, /, **how: Any) -> None:
        write(unit, address, value, **how)
        if address == CMD and value == word and not done:
            done.append(True)
            what()

    monkeypatch.setattr(bus, "write", watched)


def test_no_word_of_a_start_goes_out_twice(line: Simulator, drive: Drive) -> None:
    """Whichever confirmation is lost: it is told, and nothing is sent again."""
    before = len(asked(line))
    drive.run(10.0)
    sent = asked(line)[before:]
    drive.coast()
    line.advance(10.0)
    places = [at for at, frame in enumerate(sent) if frame in (SHUTDOWN, SWITCH_ON, FORWARD_10_HZ)]
    for place, last in zip(places, (SHUTDOWN, SWITCH_ON, FORWARD_10_HZ), strict=True):
        before = len(written(line))
        line.line.script([(place + 1, "silence")])
        with pytest.raises(Unconfirmed):
            drive.run(10.0)
        assert written(line)[before:] == [SHUTDOWN, SWITCH_ON, FORWARD_10_HZ][: places.index(place) + 1]
        assert written(line)[-1] == last
        drive.coast()
        line.advance(10.0)


def test_a_motor_that_runs_gets_the_run_alone(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    line.advance(10.0)
    before = len(written(line))
    drive.run(10.0)
    drive.run(reverse=True)
    assert written(line)[before:] == [FORWARD_10_HZ, REVERSE]


def test_a_stop_amid_it_goes_out_at_once(line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    behind(drive.bus, monkeypatch, 0x06, lambda: drive.coast(confirm=0))
    before = len(asked(line))
    with pytest.raises(Unconfirmed, match="not started: it was told to stop"):
        drive.run(10.0)
    sent = from_first_write(asked(line)[before:])
    assert sent[:2] == [SHUTDOWN, COAST]
    assert written(line) == [SHUTDOWN, COAST]


def test_a_fault_amid_it_ends_it(line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    behind(drive.bus, monkeypatch, 0x07, lambda: line.drive(1).trip(0x3110))
    with pytest.raises(Unconfirmed, match=r"OSF.*since switch on \(0007H\) was sent.*reset_fault\(\)"):
        drive.run(10.0)
    assert written(line) == [SHUTDOWN, SWITCH_ON]
    drive.reset_fault()
    assert written(line)[-1] == RESET
    drive.run(10.0)
    assert written(line)[3:] == [SHUTDOWN, SWITCH_ON, FORWARD_10_HZ]


def test_ctrl_c_amid_it_stops(line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    behind(drive.bus, monkeypatch, 0x07, interrupt)
    with pytest.raises(KeyboardInterrupt), drive.running(10.0):
        pytest.fail("it does not begin")
    assert written(line) == [SHUTDOWN, SWITCH_ON, STOP]


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    machine = line.drive(1)
    return [
        lambda: drive.prepare_control(store=True),
        lambda: drive.run(10.0),
        lambda: drive.wait_for_speed(timeout=100),
        lambda: machine.trip(0x2310),
        drive.reset_fault,
        lambda: drive.run(10.0),
        drive.coast,
        lambda: line.advance(100.0),
        lambda: drive.run(10.0),
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=100),
    ]


WHOLE = [
    *(SHUTDOWN, SWITCH_ON, FORWARD_10_HZ),
    RESET,
    *(SHUTDOWN, SWITCH_ON, FORWARD_10_HZ),
    COAST,
    *(SHUTDOWN, SWITCH_ON, FORWARD_10_HZ),
    STOP,
]


def test_a_whole_job(line: Simulator) -> None:
    with Bus(line) as bus:
        for step in program(line, bus.drive(1, "atv312", unverified=True)):
            step()
    assert written(line) == WHOLE
    assert [(at, word) for _, at, word in line.drive(1).writes() if at not in (CMD, LFR)] == [(FR1, 164), (CMI, STORE)]


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "atv312", program)
    assert written(line) == WHOLE


def test_its_maker_prints_all_that_it_takes(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "atv312")
        with pytest.raises(NotAllowed, match=r"Fr1 .*: 1, needs 164"):
            drive.run(10.0)
        assert written(line) == []
        assert bus.identify(1).candidates == ("atv312",)
        drive.prepare_control(store=True)
        drive.run(10.0)
        assert written(line) == [SHUTDOWN, SWITCH_ON, FORWARD_10_HZ]


@pytest.mark.parametrize("level", [0, 1])
def test_at_another_level_of_access_nothing_is_started_and_nothing_set(line: Simulator, level: int) -> None:
    """BBV51701, pp. 11 and 35: at L1 and L2 Modbus is no source, and ETA shows operation enabled at rest.

    L3 puts Fr1, Cd1, CHCF and tCC back, and only a return to the factory settings takes it back.
    """
    with Bus(line) as bus:
        drive = bus.drive(1, "atv312")
        drive.prepare_control(store=True)
        drive.write("LAC", level, store=True)
        before = len(line.drive(1).writes())
        for hz, reverse in ((10.0, False), (None, True)):
            with pytest.raises(NotAllowed, match=rf"has its words elsewhere:\nLAC .*: {level}, needs 2"):
                drive.run(hz, reverse=reverse)
        with pytest.raises(NotAllowed, match=rf"LAC of unit 1 is {level}, and must be 2 .*Fr1, Cd1, CHCF and tCC"):
            drive.prepare_control(store=True)
        assert [item.ok for item in drive.check_control()] == [False, True, True]
        assert len(line.drive(1).writes()) == before
        # A stop asks for nothing.
        drive.stop(confirm=0)
        assert written(line)[-1] == STOP


def test_the_command_line_says_the_words() -> None:
    told = CliRunner().invoke(cli, ["profiles", "show", "atv312"]).stdout
    assert "2063 run reverse (080FH)" in told
    assert "LAC = 2" in told
    assert "before a run or jog from rest: 6 shutdown, until fault = 0" in told
    assert Profile.builtin("atv312").command("run_reverse") == (CMD, 0x080F)
    result = CliRunner().invoke(
        cli, ["--port", "sim://atv312?clock=virtual", "--profile", "atv312", "raw", "01 06 2135 0010", "--yes"]
    )
    assert result.exit_code == 2
    assert "16 at 2135H is not a command" in result.stderr
    assert "080FH run reverse" in result.stderr


@pytest.mark.parametrize("family", ["atv12", "atv312", "atv320", "atv600", "atv71"])
def test_where_a_setpoint_would_count_otherwise_none_is_sent(family: str) -> None:
    """Bit 9 of CMI (BBV51701, p. 20; AAV49428, p. 85), which another master may set: a count is no tenth of a hertz."""
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, family, unverified=True)
        drive.prepare_control(store=True)
        drive.run(5.0)
        bus.write(1, CMI, 0x0200, force=True)
        told = len(line.drive(1).writes())
        for order in (lambda: drive.run(10.0), lambda: drive.prepare_control(store=True)):
            with pytest.raises(NotAllowed, match=r"bit 9: setpoints count 0\.1 Hz"):
                order()
        assert len(line.drive(1).writes()) == told
        # It is stopped all the same.
        drive.stop()
        drive.wait_until_stopped()
        bus.write(1, CMI, 0, force=True)
        drive.run(5.0)
        drive.wait_for_speed(5.0)
