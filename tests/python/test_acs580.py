"""An ABB ACS580: the words of an ACS355, and 20000 counts that are 46.02 and not 1105.

ACS580 firmware manual (manualarchiveguide 4817086, p. 437; manualshive 2311, p. 439; manualarchiveguide 4817085,
p. 399); ACH580 E-Clipse manual (easymanua.ls abb ach580-series), p. 152: the control word is register 400001, the
reference 400002, the status word 400004. 58.25 is register 405825: 16C0H on the wire. Bytes are typed by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from drivebus import Bus, Drive, DrivebusError, NotAllowed, Simulator, State

from .jobs import asked, carry_out_awaited

READY = "01 06 00 00 04 76"
FORWARD_10_OF_50_HZ = "01 10 00 00 00 02 04 04 7F 0F A0"
FORWARD_12_OF_60_HZ = "01 10 00 00 00 02 04 04 7F 0F A0"
STOP = "01 06 00 00 04 7E"
COAST = "01 06 00 00 04 7C"
RESET = "01 06 00 00 04 F6"
READ_PROFILE = "01 03 16 C0 00 01"

SETTINGS = {"acs355": {0x03E8: 10, 0x044E: 8}, "acs580": {0x07D0: 14, 0x0AFA: 8}}
"""What makes them obey the bus, by address."""

WRONG = [("acs355", "acs580"), ("acs580", "acs355")]
"""A unit, and what it is named."""

STARTS: dict[str, Callable[[Drive], object]] = {
    "run": lambda drive: drive.run(10.0),
    "run alone": lambda drive: drive.run(),
    "setpoint": lambda drive: setattr(drive, "setpoint", 10.0),
    "words": lambda drive: drive.write_words(0x0001, 4000),
    "prepare": lambda drive: drive.prepare_control(store=True),
    "reset": lambda drive: drive.reset_fault(),
}


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "acs580"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, "acs580", unverified=True)
        drive.prepare_control(store=True)
        yield drive


def sent(line: Simulator) -> list[str]:
    """All requests, without their CRCs."""
    return [frame[:-6] for frame in asked(line)]


def commanded(line: Simulator) -> list[str]:
    """What was written to the control word, alone or with the reference."""
    return [frame for frame in sent(line) if frame.startswith(("01 06 00 00", "01 10 00 00"))]


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
    carry_out_awaited(line, "acs580", program)
    assert commanded(line) == WHOLE


def test_the_setpoint_is_a_share_of_46_02(line: Simulator, drive: Drive) -> None:
    drive.write("46.02", 60.0, store=True)
    drive.run(12.0)
    assert commanded(line) == [READY, FORWARD_12_OF_60_HZ]
    line.advance(20.0)
    assert line.drive(1).frequency == pytest.approx(12.0, abs=0.01)
    seen = drive.monitor()
    assert (drive.state(), seen["running_frequency"]) == (State.FORWARD, 12.0)


def test_a_setting_that_is_none_of_two_is_refused(line: Simulator, drive: Drive) -> None:
    """Whoever remembers the steps of 46.02 wrongly starts nothing."""
    drive.write_words(0x11F9, 5000)
    with pytest.raises(DrivebusError, match=r"46\.02"):
        drive.run(10.0)
    assert commanded(line) == []


def test_which_control_word_it_takes_is_read_before_each_start(line: Simulator, drive: Drive) -> None:
    for _ in range(2):
        before = sent(line).count(READ_PROFILE)
        drive.run(10.0)
        assert sent(line).count(READ_PROFILE) == before + 1
        drive.stop()
        drive.wait_until_stopped(timeout=60.0)


def test_in_the_other_profile_nothing_is_started(
    line: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With 58.25 at 5 bit 0 stops and bit 1 starts, at the same register."""
    bus: Any = drive.bus
    read = bus.read_stamped

    def other(unit: int, address: int, count: int = 1, /, **how: Any) -> tuple[list[int], float, float]:
        words, asked_at, answered = read(unit, address, count, **how)
        return ([5] if address == 0x16C0 else words), asked_at, answered

    monkeypatch.setattr(bus, "read_stamped", other)
    with pytest.raises(NotAllowed, match=r"58\.25"):
        drive.run(10.0)
    assert commanded(line) == []


def test_without_the_callers_word_nothing_is_sent(line: Simulator) -> None:
    """No page of its own has the number of the register."""
    with Bus(line) as bus:
        plain = bus.drive(1, "acs580")
        starts: list[Callable[[], object]] = [lambda: plain.run(10.0), plain.stop, plain.coast, plain.reset_fault]
        for start in starts:
            with pytest.raises(NotAllowed, match="unverified=True"):
                start()
    assert commanded(line) == []


def set_up(line: Simulator, family: str) -> None:
    with Bus(line) as bus:
        for address, word in SETTINGS[family].items():
            bus.write(1, address, word)
    line.drive(1).take_writes()


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_by_the_other_name_nothing_is_written(unit: str, named: str, start: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        set_up(line, unit)
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True, variants={"base_frequency": "60 Hz"})
            for _ in range(2):
                # Where nothing is in fault, nothing is reset.
                with suppress(DrivebusError) if start == "reset" else pytest.raises(DrivebusError):
                    STARTS[start](drive)
        assert line.drive(1).writes() == []
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)


@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_a_stop_by_the_other_name_stops(unit: str, named: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        set_up(line, unit)
        with Bus(line) as bus:
            bus.drive(1, unit, unverified=True).run(10.0)
            line.advance(30.0)
        assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)
        line.drive(1).take_writes()
        with Bus(line) as bus:
            with suppress(DrivebusError):
                bus.drive(1, named, unverified=True).stop()
            line.advance(60.0)
        assert line.drive(1).speed == 0.0
        assert {word for *_, word in line.drive(1).writes()} == {0x047E}


def test_identify_tells_which_of_the_two_it_is() -> None:
    with Simulator({1: "acs355", 2: "acs580"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        assert [bus.identify(unit).family for unit in (1, 2)] == ["acs355", "acs580"]


ALSO_THE_ERRORS = """address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source
0x005A,error_1,A,,1,no,,,,ro,no,made up,made up
0x0063,error_2,B,,1,no,,,,ro,no,made up,made up
"""


def test_one_that_answers_where_the_errors_end_is_told_as_well(tmp_path: Path) -> None:
    """400090 to 400100 are error codes (ACS380 manual, p. 386); which of them answer is not printed."""
    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "profile.toml").write_text(
        'name = "more"\nsource = "made up"\nversion = 1\n[overlay]\nprofile = "acs580"\n', encoding="utf-8"
    )
    (folder / "registers.csv").write_text(ALSO_THE_ERRORS, encoding="utf-8")
    with Simulator({1: folder}, transport="process", clock="virtual") as line, Bus(line) as bus:
        assert bus.identify(1).family == "acs580"
        for address, word in SETTINGS["acs580"].items():
            bus.write(1, address, word)
        line.drive(1).take_writes()
        with pytest.raises(DrivebusError):
            bus.drive(1, "acs355", unverified=True, variants={"base_frequency": "50 Hz"}).run(10.0)
        assert line.drive(1).writes() == []
