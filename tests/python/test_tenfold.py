"""Three families run by 12H and 22H at 2000H and do not count their setpoint at 2001H alike: none gets that of another.

A YL620 counts tenths of a hertz (YL620-A manual, p. 27: x0.1HZ), a Delta MS300 hundredths (MH300 manual, p. 1021), and
so does a VFD-E (assumed: its page is not at hand). The same words start all three, so that a wrong name is ten times
the speed, or a tenth. Judged is the drive's own log: it got no word at all, whatever was tried.

That a YL620 refuses what a Delta drive has at 2100H and up is assumed, and not needed: one that answers there is known
by 200BH and 2012H, which its manual prints (pp. 27 and 28).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, DrivebusError, Simulator

from .starts import STARTS as EVERY_START

SETTINGS = {
    # What makes each obey the bus, as its keypad would have it.
    "ms300": {0x0015: 2, 0x0014: 1},
    "vfd-e": {0x0201: 3, 0x0200: 3},
    "yl620": {0x0001: 3, 0x0708: 5},
}
COUNTS = {"ms300": 500, "vfd-e": 500, "yl620": 50}
"""5 Hz."""

WRONG = [(unit, named) for unit in SETTINGS for named in SETTINGS if unit != named]

STARTS: dict[str, Callable[[Any], Any]] = {
    **EVERY_START,
    "write": lambda drive: drive.write("set_frequency", 5.0),
    "words": lambda drive: drive.write_words(0x2001, 500),
    "prepare": lambda drive: drive.prepare_control(store=True),
}


def set_up(line: Simulator, family: str) -> None:
    """The drive obeys the bus, and takes its speed from there."""
    with Bus(line) as bus:
        for address, word in SETTINGS[family].items():
            bus.write(1, address, word)
    assert len(line.drive(1).take_writes()) == len(SETTINGS[family])


@contextmanager
def obeying(family: str) -> Iterator[Simulator]:
    with Simulator({1: family}, transport="process", clock="virtual") as line:
        set_up(line, family)
        yield line


@pytest.mark.parametrize("family", SETTINGS)
def test_by_its_own_name_each_turns_as_it_was_told(family: str) -> None:
    with obeying(family) as line, Bus(line) as bus:
        drive = bus.drive(1, family, unverified=True)
        drive.run(5.0)
        drive.wait_for_speed(5.0, timeout=60.0)
        assert line.drive(1).frequency == pytest.approx(5.0)
        assert sorted(word for *_, word in line.drive(1).writes()) == [0x12, COUNTS[family]]
        assert drive.status().frequency == pytest.approx(5.0)
        drive.stop()
        drive.wait_until_stopped(timeout=60.0)


@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_the_words_of_one_start_the_other(unit: str, named: str) -> None:
    """Why it matters: nothing but the answers tells them apart."""
    with obeying(unit) as line, Bus(line) as bus:
        bus.write(1, 0x2001, COUNTS[named], force=True)
        bus.write(1, 0x2000, 0x12, force=True)
        line.advance(100.0)
        times = COUNTS[named] / COUNTS[unit]
        assert line.drive(1).frequency == pytest.approx(5.0 * times)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_by_a_wrong_name_nothing_is_written(unit: str, named: str, start: str) -> None:
    with obeying(unit) as line, Bus(line) as bus:
        drive = bus.drive(1, named, unverified=True)
        # Where nothing is in fault, nothing is reset.
        with suppress(DrivebusError) if start == "reset" else pytest.raises(DrivebusError):
            STARTS[start](drive)
        # It is not forgotten by having been said.
        with suppress(DrivebusError):
            STARTS[start](drive)
        assert line.drive(1).writes() == []
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)


@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_it_is_told_why(unit: str, named: str) -> None:
    with obeying(unit) as line, Bus(line) as bus:
        drive = bus.drive(1, named, unverified=True)
        with pytest.raises(DrivebusError):
            drive.write_words(0x2001, 500)
        assert drive.contradiction() is not None


@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_awaited_the_same(unit: str, named: str) -> None:
    async def main(line: Simulator) -> None:
        async with drivebus.aio.Bus(line) as bus:
            drive = await bus.drive(1, named, unverified=True)
            with pytest.raises(DrivebusError):
                await drive.run(5.0)

    with obeying(unit) as line:
        asyncio.run(main(line))
        assert line.drive(1).writes() == []


def test_a_stop_by_a_wrong_name_stops() -> None:
    """All three stop by 1 at 2000H."""
    for unit, named in WRONG:
        with obeying(unit) as line:
            with Bus(line) as bus:
                bus.drive(1, unit, unverified=True).run(5.0)
                line.advance(30.0)
            assert line.drive(1).frequency == pytest.approx(5.0)
            line.drive(1).take_writes()
            with Bus(line) as bus:
                bus.drive(1, named, unverified=True).stop()
                line.advance(60.0)
            assert line.drive(1).speed == 0.0, (unit, named)
            assert {word for *_, word in line.drive(1).writes()} == {1}, (unit, named)


ALSO_DELTA = """address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source
0x2100,more_1,A,,1,no,,,,ro,no,made up,made up
0x2101,more_2,B,,1,no,,,,ro,no,made up,made up
0x2102,more_3,C,,1,no,,,,ro,no,made up,made up
0x2103,more_4,D,,1,no,,,,ro,no,made up,made up
0x2104,more_5,E,,1,no,,,,ro,no,made up,made up
0x2105,more_6,F,,1,no,,,,ro,no,made up,made up
0x2106,more_7,G,,1,no,,,,ro,no,made up,made up
0x2108,more_8,H,,1,no,,,,ro,no,made up,made up
0x2109,more_9,I,,1,no,,,,ro,no,made up,made up
0x3000,more_10,J,,1,no,,,,ro,no,made up,made up
0x0014,more_11,K,,1,no,,,,rw,no,made up,made up
0x0015,more_12,L,,1,no,,,,rw,no,made up,made up
0x0200,more_13,M,,1,no,,,,rw,no,made up,made up
0x0201,more_14,N,,1,no,,,,rw,no,made up,made up
"""
"""A YL620 that answers all that Delta and INVT drives have there, their control settings among it."""


def more(folder: Path, family: str, rows: str) -> Path:
    """A drive of *family* with more words: a profile of somebody's own, from which it is simulated."""
    folder.mkdir()
    (folder / "profile.toml").write_text(
        f'name = "more"\nsource = "made up"\nversion = 1\n[overlay]\nprofile = "{family}"\n', encoding="utf-8"
    )
    (folder / "registers.csv").write_text(rows, encoding="utf-8")
    return folder


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("named", ["ms300", "vfd-e"])
def test_one_that_answers_as_a_delta_drive_does_gets_nothing(tmp_path: Path, named: str, start: str) -> None:
    folder = more(tmp_path / "more", "yl620", ALSO_DELTA)
    with Simulator({1: folder}, transport="process", clock="virtual") as line, Bus(line) as bus:
        for place in (0x2008, 0x2009, 0x200B, 0x2012, 0x2100, 0x2101, 0x2104, 0x2106, 0x2109, 0x3000):
            assert len(bus.read(1, place)) == 1
        for place, word in SETTINGS[named].items():
            # By chance it is set as the Delta drive would be.
            bus.write(1, place, word)
        line.drive(1).take_writes()
        drive: Drive = bus.drive(1, named, unverified=True)
        # There is nothing to set, and nothing to reset.
        is_done = start in ("prepare", "reset")
        with suppress(DrivebusError) if is_done else pytest.raises(DrivebusError):
            STARTS[start](drive)
        assert line.drive(1).writes() == []
