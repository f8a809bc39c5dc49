"""An Invertek Optidrive E3, and those that have something else at 0000H, where it takes its commands.

Optidrive ODE-3 fieldbus guide 1.00 (manualslib 2162510), p. 35: register 1 is 0 to stop, 1 to run, bit 2 resets, bit 3
coasts; register 2 is the setpoint, 200 for 20.0 Hz. Optidrive ODE-2 guide (manualslib 2719256), p. 25: one has to be
taken away for the wire. Bytes are typed by hand; judged is the drive's own log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

import drivebus
from drivebus import BadArgument, Bus, Drive, DrivebusError, NotAllowed, Profile, Refused, Simulator, State

from .jobs import carry_out_awaited, written

OBEY = "01 06 00 8B 00 03"
SET_20_HZ = "01 06 00 01 00 C8"
RUN = "01 06 00 00 00 01"
STOP = "01 06 00 00 00 00"
COAST = "01 06 00 00 00 08"
RESET = "01 06 00 00 00 04"

SETTINGS: dict[str, dict[int, int]] = {
    # What makes each obey the bus, as its keypad would have it.
    "optidrive-e3": {0x008B: 3},
    "acs355": {0x03E8: 10, 0x044E: 8},
    "acs580": {0x07D0: 14, 0x0AFA: 8},
    "gd350": {0x0001: 2, 0x0002: 0, 0x0006: 8},
    "gd600": {0x0001: 2, 0x0006: 8},
    "gd3000": {0x0001: 2, 0x0006: 8},
    "md500": {0xF002: 2, 0xF003: 9},
    "yl620": {0x0001: 3, 0x0708: 5},
    "fr-d700": {0x0539: 0, 0x053B: 1},
    "a1000": {},
    "v20": {},
    "chf100a": {},
}
WRONG = [("optidrive-e3", named) for named in [*SETTINGS, "wj200", "h100", "ms300"] if named != "optidrive-e3"]
WRONG += [(unit, "optidrive-e3") for unit in SETTINGS if unit != "optidrive-e3"]

STARTS: dict[str, Callable[[Any], Any]] = {
    "run": lambda drive: drive.run(5.0),
    "run, forced": lambda drive: drive.run(5.0, force=True),
    "run as it was set": lambda drive: drive.run(),
    "jog": lambda drive: drive.jog(),
    "setpoint": lambda drive: setattr(drive, "setpoint", 5.0),
    "words at 0000H": lambda drive: drive.write_words(0x0000, 1, force=True),
    "prepare": lambda drive: drive.prepare_control(store=True),
    "reset": lambda drive: drive.reset_fault(),
}


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "optidrive-e3"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "optidrive-e3", unverified=True)


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    return [
        lambda: drive.prepare_control(store=True),
        lambda: drive.run(20.0),
        lambda: drive.wait_for_speed(20.0, timeout=100),
        lambda: line.drive(1).trip(3),
        drive.reset_fault,
        drive.run,
        drive.coast,
        lambda: line.advance(100.0),
        drive.run,
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=100),
    ]


WHOLE = [OBEY, SET_20_HZ, RUN, RESET, RUN, COAST, RUN, STOP]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert written(line) == WHOLE


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "optidrive-e3", program)
    assert written(line) == WHOLE


def test_what_it_does_is_told_and_which_way_is_not(line: Simulator, drive: Drive) -> None:
    drive.prepare_control(store=True)
    assert drive.status().state is State.STOPPED
    drive.run(20.0)
    line.advance(30.0)
    seen = drive.monitor()
    assert (drive.status().state, seen["running_frequency"]) == (State.RUNNING, 20.0)
    # Volts, and no tenths of them.
    assert 500.0 < seen["bus_voltage"] < 600.0
    with pytest.raises(NotAllowed, match="run_reverse"):
        drive.run(reverse=True)


def test_a_fault_is_the_high_byte_while_it_is_tripped(line: Simulator, drive: Drive) -> None:
    drive.prepare_control(store=True)
    line.drive(1).trip(14)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.label) == (14, "Input phase loss")
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run()
    drive.reset_fault()
    assert drive.fault() is None
    assert written(line) == [OBEY, RESET]


def test_the_byte_order_of_the_user_guide_proves_no_rest() -> None:
    """There 0100H is a drive that runs (ODE-3 user guide 1.00, p. 33); here it would be one that is stopped."""
    profile = Profile.builtin("optidrive-e3")
    assert profile.state(0x0100) == State.STOPPED.value
    assert profile.rest_by_frequency()


def test_a_setpoint_above_the_highest_frequency_is_refused(line: Simulator, drive: Drive) -> None:
    """ODE-3 fieldbus guide 1.00, p. 35: above P-01 it answers by an exception."""
    drive.prepare_control(store=True)
    line.drive(1).take_writes()
    with pytest.raises(BadArgument):
        drive.run(500.1)
    with pytest.raises(Refused):
        drive.bus.write(1, 0x0001, 5001)
    assert line.drive(1).state == "stopped"


def test_nothing_goes_out_without_unverified(line: Simulator) -> None:
    """No page of it at hand says which address register 1 is on the wire."""
    with Bus(line) as bus:
        plain = bus.drive(1, "optidrive-e3")
        tried: list[Callable[[], Any]] = [plain.run, plain.stop, plain.coast]
        tried.append(lambda: setattr(plain, "setpoint", 5.0))
        for told in tried:
            with pytest.raises(NotAllowed):
                told()
    assert written(line) == []


@contextmanager
def obeying(family: str) -> Iterator[Simulator]:
    """One drive of *family* that obeys the bus, and takes its speed from there."""
    with Simulator({1: family}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            for address, word in SETTINGS[family].items():
                bus.write(1, address, word)
        line.drive(1).take_writes()
        yield line


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


@pytest.mark.parametrize("command", ["stop", "coast"])
@pytest.mark.parametrize("named", [named for unit, named in WRONG if unit == "optidrive-e3"])
def test_by_a_wrong_name_it_is_halted_by_its_own_word(named: str, command: str) -> None:
    with obeying("optidrive-e3") as line:
        with Bus(line) as bus:
            bus.write(1, 0x0001, 200)
            bus.write(1, 0x0000, 1)
            line.advance(30.0)
        assert line.drive(1).frequency == 20.0
        line.drive(1).take_writes()
        with Bus(line) as bus:
            with suppress(DrivebusError):
                getattr(bus.drive(1, named, unverified=True), command)()
            line.advance(60.0)
        halts = [word for _, place, word in line.drive(1).writes()]
        # An FR-D700 has no word that coasts.
        assert halts in ([0], [8]) if "coast" in Profile.builtin(named).commands() or command == "stop" else [[]]


@pytest.mark.parametrize("command", ["stop", "coast"])
@pytest.mark.parametrize("unit", [unit for unit, named in WRONG if named == "optidrive-e3"])
def test_by_its_name_no_other_one_is_started_or_set(unit: str, command: str) -> None:
    with obeying(unit) as line, Bus(line) as bus:
        before = line.drive(1).eeprom_writes
        with suppress(DrivebusError):
            getattr(bus.drive(1, "optidrive-e3", unverified=True), command)()
        line.advance(30.0)
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)
        assert line.drive(1).eeprom_writes == before


def test_it_is_known_by_its_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == ("optidrive-e3", "by answers")


def test_no_other_family_is_taken_for_one() -> None:
    families = [name for name in drivebus.profiles() if name not in ("optidrive-e3", "huanyang-hy")]
    for family in families:
        with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
            assert bus.identify(1).family != "optidrive-e3", family
