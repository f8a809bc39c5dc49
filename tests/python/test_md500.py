"""An Inovance MD500 beside the families that take commands at 2000H as well, and beside those that take them at 1000H.

Its codes are those of a Goodrive but for 5, which coasts, and 6, which stops along the ramp (MD500 user manual, p. 226;
GD350 operation manual, section 9.4.5: 5 stops, 6 coasts). 1 stops an MS300 (CP2000 manual, p. 514) and runs an MD500; 6
runs an MS300 and stops an MD500; 5 runs an EDS300 (its manual, p. 44). A CHF100A is commanded at 1000H, where an MD500
has its setpoint. Judged is the drive's own log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

from drivebus import BadArgument, Bus, Drive, DrivebusError, NotReady, Simulator

from .starts import STARTS as EVERY_START

SETTINGS: dict[str, dict[int, int]] = {
    # What makes each obey the bus, as its keypad would have it.
    "md500": {0xF002: 2, 0xF003: 9},
    "gd350": {0x0001: 2, 0x0002: 0, 0x0006: 8},
    "gd20": {0x0001: 2, 0x0006: 8},
    "gd600": {0x0001: 2, 0x0006: 8},
    "ms300": {0x0015: 2, 0x0014: 1},
    "yl620": {0x0001: 3, 0x0708: 5},
    "eds300": {},
    "chf100a": {},
    "saj8000m": {},
}
WRONG = [("md500", named) for named in SETTINGS if named != "md500"]
WRONG += [(unit, "md500") for unit in SETTINGS if unit != "md500"]

STARTS: dict[str, Callable[[Any], Any]] = {
    **EVERY_START,
    # One count is a share of 0.01 % here, and runs a CHF100A.
    "least setpoint": lambda drive: setattr(drive, "setpoint", 0.005),
    "words at 1000H": lambda drive: drive.write_words(0x1000, 1, force=True),
    "words at 2000H": lambda drive: drive.write_words(0x2000, 1, force=True),
    "prepare": lambda drive: drive.prepare_control(store=True),
}


@contextmanager
def obeying(family: str) -> Iterator[Simulator]:
    """One drive of *family* that obeys the bus, and takes its speed from there."""
    with Simulator({1: family}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            for address, word in SETTINGS[family].items():
                bus.write(1, address, word)
        line.drive(1).take_writes()
        yield line


def turning(line: Simulator, family: str) -> None:
    """It turns forward at 10 Hz, or as its keypad has it."""
    with Bus(line) as bus:
        place = 0x1000 if family in ("chf100a", "saj8000m") else 0x2000
        if family == "md500":
            bus.write(1, 0x1000, 2000)
        elif place == 0x2000:
            bus.write(1, 0x2001, 100 if family == "yl620" else 1000)
        bus.write(1, place, {"ms300": 0x12, "yl620": 0x12, "eds300": 7}.get(family, 1))
        line.advance(30.0)
    assert line.drive(1).speed > 0.0
    line.drive(1).take_writes()


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_by_a_wrong_name_nothing_is_written(unit: str, named: str, start: str) -> None:
    with obeying(unit) as line, Bus(line) as bus:
        drive: Drive = bus.drive(1, named, unverified=True)
        # Where nothing is in fault nothing is reset, and where nothing is to be set nothing is prepared.
        is_done = start in ("reset", "prepare")
        with suppress(DrivebusError, ValueError) if is_done else pytest.raises((DrivebusError, ValueError)):
            STARTS[start](drive)
        assert line.drive(1).writes() == []
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)


@pytest.mark.parametrize("command", ["stop", "coast", "jog_stop"])
@pytest.mark.parametrize(("unit", "named"), WRONG)
@pytest.mark.parametrize("turns", [False, True])
def test_a_halt_by_a_wrong_name_starts_nothing_and_halts(unit: str, named: str, command: str, turns: bool) -> None:
    with obeying(unit) as line:
        if turns:
            turning(line, unit)
        before = line.drive(1).frequency
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True)
            # Not each family has a coast, or a word that ends a jog.
            with suppress(DrivebusError, BadArgument):
                getattr(drive, command)()
            line.advance(60.0)
        assert abs(line.drive(1).frequency) <= abs(before)
        assert line.drive(1).state != "reverse"
        if command == "stop":
            assert line.drive(1).speed == 0.0
        # What is kept in EEPROM is not touched.
        assert not [place for _, place, _ in line.drive(1).writes() if place >= 0xF000 or place < 0x1000]


@pytest.mark.parametrize(("command", "word"), [("stop", 6), ("coast", 5)])
def test_named_as_a_goodrive_it_gets_its_own_word(command: str, word: int) -> None:
    with obeying("md500") as line:
        turning(line, "md500")
        with Bus(line) as bus:
            getattr(bus.drive(1, "gd350", unverified=True), command)()
        assert [(place, each) for _, place, each in line.drive(1).writes()] == [(0x2000, word)]


@pytest.mark.parametrize(("command", "word"), [("stop", 5), ("coast", 6)])
def test_a_goodrive_that_is_named_as_one_gets_its_own_word(command: str, word: int) -> None:
    with obeying("gd350") as line:
        turning(line, "gd350")
        with Bus(line) as bus:
            getattr(bus.drive(1, "md500", unverified=True), command)()
        assert [(place, each) for _, place, each in line.drive(1).writes()] == [(0x2000, word)]


@pytest.mark.parametrize(("highest", "counts"), [(5_000, 4_000), (6_000, 3_333), (10_000, 2_000), (40_000, 500)])
def test_a_setpoint_is_a_share_of_whatever_is_the_highest_frequency(highest: int, counts: int) -> None:
    """+10000 is +100.00 % of F0-10 (MD500-Plus manual, p. 702)."""
    with obeying("md500") as line, Bus(line) as bus:
        bus.write(1, 0xF00A, highest)
        line.drive(1).take_writes()
        drive = bus.drive(1, "md500", unverified=True)
        drive.run(20.0)
        assert [(place, word) for _, place, word in line.drive(1).writes()] == [(0x1000, counts), (0x2000, 1)]
        drive.wait_for_speed(20.0, timeout=60.0)
        assert line.drive(1).frequency == pytest.approx(20.0, abs=0.01)


def test_one_whose_frequencies_have_one_decimal_is_not_started() -> None:
    """F0-10 would count tenths of a hertz, and each setpoint be a share of a tenth of it."""
    with obeying("md500") as line, Bus(line) as bus:
        bus.write(1, 0xF016, 1)
        line.drive(1).take_writes()
        drive = bus.drive(1, "md500", unverified=True)
        with pytest.raises(NotReady, match="F0-22 frequencies have two decimals: 1, needs 2"):
            drive.run(5.0)
        with suppress(DrivebusError):
            drive.prepare_control(store=True)
        assert line.drive(1).writes() == []


def test_a_parameter_is_kept_at_f0_and_in_ram_at_00() -> None:
    """F0-16 is at F010H and 0010H (MD500 user manual, p. 225): a word at 0002H is F0-02, until the power goes."""
    with Simulator({1: "md500"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.write(1, 0x0002, 2)
        assert bus.read(1, 0xF002) == [2]
        assert line.drive(1).eeprom_writes_of(0xF002) == 0
        bus.write(1, 0xF002, 2)
        assert line.drive(1).eeprom_writes_of(0xF002) == 1
