"""A Mitsubishi FR-D700: one register is the state and takes commands, and of two setpoints one wears EEPROM.

Words typed by hand: 0008H by 1, 2 and 4 (bbctrl-firmware, vfd_spindle.c, fr_d700_regs); 05 06 00 0D 17 70 is 60 Hz (the
manual, p. 206, as PortDock quotes it). At 0008H others have a parameter or an output. Judged is the drive's own log.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import BadArgument, Bus, Drive, DrivebusError, NotAllowed, NotReady, Profile, Simulator

from .starts import STARTS as EVERY_START

OBEYS = {0x0539: 0, 0x053A: 0, 0x053B: 1}
"""Pr.338, Pr.339 and Pr.340."""

OTHERS: dict[str, dict[int, int]] = {
    # What makes each obey the bus.
    "gd350": {0x0001: 2, 0x0002: 0, 0x0006: 8},
    "gd600": {0x0001: 2, 0x0006: 8},
    "vfd500": {0x0002: 2},
    "md500": {0xF002: 2, 0xF003: 9},
    "a1000": {},
    "acs355": {},
    "v20": {},
    "wj200": {},
    "h100": {0x0001: 2, 0x0002: 2},
    "ms300": {0x0015: 2, 0x0014: 1},
    "eds300": {},
}
WRONG = [("fr-d700", named) for named in OTHERS] + [(unit, "fr-d700") for unit in OTHERS]

STARTS: dict[str, Callable[[Any], Any]] = {
    **EVERY_START,
    "words at 0008H": lambda drive: drive.write_words(0x0008, 2, force=True),
    "words at 0001H": lambda drive: drive.write_words(0x0001, 0, force=True),
    "prepare": lambda drive: drive.prepare_control(store=True),
}


@contextmanager
def obeying(family: str) -> Iterator[Simulator]:
    with Simulator({1: family}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            for address, word in (OBEYS if family == "fr-d700" else OTHERS[family]).items():
                bus.write(1, address, word)
        line.drive(1).take_writes()
        yield line


@pytest.fixture
def line() -> Iterator[Simulator]:
    with obeying("fr-d700") as line:
        yield line


def writes(line: Simulator) -> list[tuple[int, int]]:
    return [(place, word) for _, place, word in line.drive(1).writes()]


def test_it_runs_both_ways_and_stops(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "fr-d700", unverified=True)
        drive.run(20.0)
        drive.wait_for_speed(20.0, timeout=60.0)
        assert str(drive.status()).startswith("forward, 20.00 of 20.00 Hz, commands from communication")
        drive.stop()
        drive.wait_until_stopped(timeout=60.0)
        assert line.drive(1).speed == 0.0
        drive.run(20.0, reverse=True)
        line.advance(30.0)
        assert str(drive.status()).startswith("reverse, 20.00 of 20.00 Hz")
        drive.stop()
    assert writes(line) == [(0x000D, 2000), (8, 2), (8, 1), (0x000D, 2000), (8, 4), (8, 1)]
    # 000EH, the setpoint that is kept, is left alone.
    assert line.drive(1).eeprom_writes_of(0x000E) == 0


def test_an_example_of_the_manual_is_what_goes_out(line: Simulator) -> None:
    """05 06 00 0D 17 70 17 99: 60 Hz to register 40014, but for the address of the unit."""
    with Bus(line) as bus:
        bus.drive(1, "fr-d700", unverified=True).setpoint = 60.0
        sent = [data[1:6].hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] in (6, 16)]
    assert sent[-1] == "06 00 0d 17 70"


def test_a_parameter_is_999_above_its_number() -> None:
    profile = Profile.builtin("fr-d700")
    for number in (1, 2, 7, 8, 79, 117, 118, 120, 122, 338, 339, 340, 549):
        assert profile.describe(f"Pr.{number}").place == number + 999


def test_from_the_factory_it_does_not_obey_and_is_not_started() -> None:
    with Simulator({1: "fr-d700"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "fr-d700", unverified=True)
        with pytest.raises(NotReady, match="terminal"):
            drive.run(5.0)
        assert writes(line) == []
        drive.prepare_control(store=True)
        assert writes(line) == [(0x053B, 1)]
        drive.run(5.0)
        assert writes(line)[1:] == [(0x000D, 500), (8, 2)]


def test_without_unverified_nothing_goes_out(line: Simulator) -> None:
    with Bus(line) as bus:
        drive = bus.drive(1, "fr-d700")
        for start in (Drive.run, Drive.stop):
            with pytest.raises(NotAllowed):
                start(drive)
    assert writes(line) == []


def test_a_fault_shows_and_cannot_be_reset(line: Simulator) -> None:
    with Bus(line) as bus:
        line.drive(1).trip(16)
        drive = bus.drive(1, "fr-d700", unverified=True)
        assert drive.status().state == "fault"
        with pytest.raises((NotAllowed, BadArgument), match="reset_fault"):
            drive.reset_fault()
    assert writes(line) == []


def test_what_sets_parameters_back_has_names_that_no_restore_writes() -> None:
    profile = Profile.builtin("fr-d700")
    for place in (0x0001, 0x0002, 0x0003, 0x0005, 0x0006):
        [name] = [name for name in profile.names() if profile.describe(name).place == place]
        assert (profile.describe(name).access, profile.describe(name).verified) == ("wo", False)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_by_a_wrong_name_nothing_is_written(unit: str, named: str, start: str) -> None:
    with obeying(unit) as line, Bus(line) as bus:
        drive = bus.drive(1, named, unverified=True)
        is_done = start in ("reset", "prepare")
        with suppress(DrivebusError, ValueError) if is_done else pytest.raises((DrivebusError, ValueError)):
            STARTS[start](drive)
        assert writes(line) == []
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)


@pytest.mark.parametrize("command", ["stop", "coast", "jog_stop"])
@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_a_halt_by_a_wrong_name_starts_and_keeps_nothing(unit: str, named: str, command: str) -> None:
    with obeying(unit) as line:
        before = line.drive(1).eeprom_writes
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True)
            with suppress(DrivebusError, BadArgument):
                getattr(drive, command)()
            line.advance(60.0)
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)
        assert line.drive(1).eeprom_writes == before


@pytest.mark.parametrize("named", OTHERS)
def test_one_that_turns_is_stopped_by_its_own_word_whatever_its_name(named: str) -> None:
    with obeying("fr-d700") as line:
        with Bus(line) as bus:
            bus.write(1, 0x000D, 1000)
            bus.write(1, 0x0008, 2)
            line.advance(30.0)
        assert line.drive(1).frequency == pytest.approx(10.0)
        line.drive(1).take_writes()
        with Bus(line) as bus:
            bus.drive(1, named, unverified=True).stop()
            line.advance(60.0)
        assert (writes(line), line.drive(1).speed) == ([(8, 1)], 0.0)


def test_awaited_the_same(line: Simulator) -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(line) as bus:
            drive = await bus.drive(1, "fr-d700", unverified=True)
            await drive.run(5.0)
            await drive.stop()

    asyncio.run(main())
    assert writes(line) == [(0x000D, 500), (8, 2), (8, 1)]
