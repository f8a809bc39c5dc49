"""A Schneider Altivar 12 beside an Altivar 312: the same words at the same place; what differs is told before a write.

The maker's list of its parameters (BBV51917, 1.4IE05) has CMD at 8501, ETA at 3201 with bit 4 always 1, LFt at 7121, no
level of access, nothing at 8606, HMIS at 3240 and no torque at 3205. That 6, 7 and 15 start it, and that ETA shows 50H,
31H, 33H and 37H then, is quoted from its Modbus manual (BBV28590) by nobrega8/mbmap-library. The frames are those of
`test_atv`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import permutations
from typing import Any

import pytest
from click.testing import CliRunner

from drivebus import BadArgument, Bus, Drive, DrivebusError, NotAllowed, Simulator, State
from drivebus.cli import cli

from .jobs import asked, carry_out_awaited
from .test_atv import (
    CMD,
    CMI,
    COAST,
    ETA,
    FORWARD,
    FORWARD_10_HZ,
    FR1,
    LFR,
    READ_ETA,
    RESET,
    REVERSE_10_HZ,
    SHUTDOWN,
    STOP,
    STORE,
    SWITCH_ON,
    from_first_write,
    written,
)

LFT, SPEED_COMMAND, SCANNER = 7121, 8601, 12761
READ_LFT = "01 03 1B D1 00 01 D2 D7"


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "atv12"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    """One that obeys the bus, and was written to before: it has been asked what it is."""
    with Bus(line) as bus:
        drive = bus.drive(1, "atv12")
        drive.prepare_control(store=True)
        yield drive


def test_a_start_is_these_bytes_and_no_others(line: Simulator, drive: Drive) -> None:
    before = len(asked(line))
    drive.run(10.0)
    sent = from_first_write(asked(line)[before:])
    look = [READ_ETA, READ_LFT]
    assert sent == [SHUTDOWN, *look, SWITCH_ON, *look, FORWARD_10_HZ, *look]
    assert drive.state() is State.FORWARD
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(10.0)


def test_eta_shows_the_state_on_the_way(drive: Drive) -> None:
    shown = []
    for word in (0x00, 0x06, 0x07, 0x0F):
        drive.write_words(CMD, word)
        shown.append(drive.bus.read(1, ETA)[0])
    assert shown == [0x0250, 0x0231, 0x0233, 0x0237]


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    return [
        lambda: drive.prepare_control(store=True),
        lambda: drive.run(10.0),
        lambda: line.advance(20.0),
        lambda: drive.stop(),
        lambda: line.advance(20.0),
        lambda: drive.run(10.0, reverse=True),
        lambda: line.advance(20.0),
        lambda: drive.coast(),
        lambda: line.advance(60.0),
        lambda: line.drive(1).trip(17),
        lambda: drive.reset_fault(),
        lambda: drive.run(),
        lambda: drive.stop(),
    ]


WHOLE = [
    *(SHUTDOWN, SWITCH_ON, FORWARD_10_HZ, STOP),
    *(SHUTDOWN, SWITCH_ON, REVERSE_10_HZ, COAST, RESET),
    *(SHUTDOWN, SWITCH_ON, FORWARD, STOP),
]


def test_a_whole_job(line: Simulator) -> None:
    with Bus(line) as bus:
        for step in program(line, bus.drive(1, "atv12")):
            step()
    assert written(line) == WHOLE
    assert [(at, word) for _, at, word in line.drive(1).writes() if at not in (CMD, LFR)] == [(FR1, 164), (CMI, STORE)]


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "atv12", program)
    assert written(line) == WHOLE


def test_without_fr1_it_is_not_started_and_needs_no_level_of_access(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "atv12")
        with pytest.raises(NotAllowed, match=r"Fr1 .*: 1, needs 164"):
            drive.run(10.0)
        assert line.drive(1).writes() == []
        assert [item.code for item in drive.check_control()] == ["Fr1", "extended_control_word"]


def test_a_fault_has_the_numbers_of_lft_and_is_over_with_the_reset(line: Simulator, drive: Drive) -> None:
    """17 is OLF, 5 SLF1; LFt and dP0 keep the number."""
    line.drive(1).trip(17)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (17, "OLF")
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run(10.0)
    drive.reset_fault()
    assert drive.bus.read(1, LFT) == [17]
    assert drive.fault() is None
    line.drive(1).trip(5)
    drive.reset_fault()
    assert [entry.code for entry in drive.fault_history()][:2] == [5, 17]
    drive.run(10.0)
    assert drive.state() is State.FORWARD


@pytest.mark.parametrize(("place", "name"), [(SPEED_COMMAND, "speed_command"), (SCANNER, "scanner_write_1")])
def test_where_a_command_gets_through_too_is_no_setting(line: Simulator, drive: Drive, place: int, name: str) -> None:
    """In the simulated drive 15 there starts it at once, without 6 and 7."""
    with pytest.raises(BadArgument, match="can move the motor"):
        drive.write(name, 15)
    assert line.drive(1).state == "stopped"
    port = ["--port", "sim://atv12?clock=virtual", "--profile", "atv12"]
    result = CliRunner().invoke(cli, [*port, "raw", f"01 06 {place:04X} 000F"])
    assert result.exit_code == 2
    assert f"write {name} = 15), which can move the motor" in result.stderr
    drive.bus.write(1, place, 15)
    line.advance(1.0)
    assert line.drive(1).state == "forward"


STARTS: dict[str, Callable[[Any], Any]] = {
    "run": lambda drive: drive.run(5.0),
    "run, forced": lambda drive: drive.run(5.0, force=True),
    "run in reverse": lambda drive: drive.run(5.0, reverse=True),
    "run as it was set": lambda drive: drive.run(),
    "setpoint": lambda drive: setattr(drive, "setpoint", 5.0),
    "words": lambda drive: drive.write_words(CMD, 6),
    "prepare": lambda drive: drive.prepare_control(store=True),
    "parameter": lambda drive: drive.write("ACC", 5.0, store=True),
    "reset": lambda drive: drive.reset_fault(),
    "stop": lambda drive: drive.stop(),
    "coast": lambda drive: drive.coast(),
}


@pytest.mark.parametrize("what", STARTS)
@pytest.mark.parametrize(("unit", "named"), list(permutations(("atv12", "atv312", "atv320", "atv600", "atv71"), 2)))
def test_by_the_name_of_another_it_gets_no_word_but_a_halt(unit: str, named: str, what: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            bus.write(1, FR1, 164)
        with Bus(line) as bus, suppress(DrivebusError):
            STARTS[what](bus.drive(1, named, unverified=True))
        line.advance(10.0)
        machine = line.drive(1)
        assert (machine.state, machine.frequency, machine.eeprom_writes) == ("stopped", 0.0, 0)
        # A stop and a coast are the same words to all five.
        halts = {"stop": {(CMD, 7)}, "coast": {(CMD, 0)}}.get(what, set())
        first, *later = [(at, word) for _, at, word in machine.writes()]
        assert first == (FR1, 164)
        assert set(later) == halts


@pytest.mark.parametrize("family", ["atv12", "atv312", "atv320", "atv600", "atv71"])
def test_each_is_known_by_its_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
        assert (found.candidates, found.certainty) == ((family,), "by answers")


def test_the_command_line_says_what_must_be_set() -> None:
    told = CliRunner().invoke(cli, ["profiles", "show", "altivar 12"]).stdout
    assert "Fr1 = 164" in told
    assert "LAC" not in told
    assert "2063 run reverse (080FH)" in told
