"""docs/errors.md: each message that the page explains is one that is raised, and by the error that it says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, DrivebusError, Simulator

PAGE = (Path(__file__).resolve().parents[2] / "docs/errors.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| `([^`]+)` \| `(\w+)` \|", PAGE, re.MULTILINE))


class Place:
    """A simulated line, and what is asked of it."""

    def __init__(self, stack: ExitStack) -> None:
        self.stack = stack

    def bus(self, *families: str, read_only: bool = False) -> Bus:
        units = dict(enumerate(families or ("gd350",), start=1))
        self.simulator = self.stack.enter_context(Simulator(units, transport="process", clock="virtual", seed=1))
        self.line = self.stack.enter_context(Bus(self.simulator, timeout=0.1, retries=0, read_only=read_only))
        return self.line

    def drive(self) -> Drive:
        """A drive that obeys the bus."""
        drive = self.bus().drive(1)
        drive.prepare_control()
        return drive

    def running(self) -> Drive:
        drive = self.drive()
        drive.run(10.0)
        return drive

    def spoilt(self, kind: str) -> Bus:
        """A line on which every answer is hit by this, behind one that was whole."""
        bus = self.bus()
        bus.read(1, 0x2100)
        self.simulator.line.set_faults(**{kind: 1.0})
        return bus


def no_port(place: Place) -> None:
    place.stack.enter_context(Bus("/dev/ttyUSB77"))


def used(place: Place) -> None:
    """Another kind of program has the port."""
    simulator = place.stack.enter_context(Simulator({1: "gd350"}))
    holder = (
        "import serial, sys; port = serial.Serial(sys.argv[1], exclusive=True); print(flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", holder, simulator.port], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    place.stack.enter_context(other)
    place.stack.callback(other.kill)
    assert other.stdout is not None
    other.stdout.readline()
    place.stack.enter_context(Bus(simulator.port, parity="N"))


def closed(place: Place) -> None:
    bus = place.bus()
    bus.close()
    bus.read(1, 0x2100)


def gone(place: Place) -> None:
    simulator = place.stack.enter_context(Simulator({1: "gd350"}))
    bus = place.stack.enter_context(Bus(simulator.port, parity="N"))
    bus.read(1, 0x2100)
    simulator.line.unplug()
    bus.write(1, 0x800B, 100)


def silent(place: Place) -> None:
    place.bus().read(9, 0x2100)


def silent_again(place: Place) -> None:
    bus = place.bus()
    for _ in range(2):
        with suppress(drivebus.NoAnswer):
            bus.read(9, 0x2100)
        bus.read(1, 0x2100)
    bus.read(9, 0x2100)


def refused(code: int) -> Callable[[Place], None]:
    def ask(place: Place) -> None:
        bus = place.bus()
        place.simulator.drive(1).refuse(code)
        bus.read(1, 0x2100)

    return ask


def in_fault(place: Place) -> None:
    drive = place.drive()
    place.simulator.drive(1).trip("OL1")
    drive.run(10.0)


def stopped_meanwhile(place: Place) -> None:
    """Somebody stops the drive while a start looks at it."""
    drive = place.drive()
    before = place.line.halts(1)
    drive.stop()
    place.line.write(1, 0x2000, 1, halts=before)


def lossy(place: Place) -> None:
    drive = place.drive()
    place.simulator.line.set_faults(deaf=1.0)
    for _ in range(6):
        with suppress(DrivebusError):
            drive.status()
    drive.run(10.0)


def lost_stop(place: Place) -> None:
    drive = place.running()
    place.simulator.line.set_faults(silence=1.0)
    drive.stop()


def unmoved(place: Place) -> None:
    """A GD10 whose keypad has the say, where no page says so."""
    place.bus("gd10").drive(1, "gd10").run()


def lost_stops(place: Place) -> None:
    place.running()
    place.simulator.line.set_faults(silence=1.0)
    place.line.stop_all()


CASES: dict[str, Callable[[Place], object]] = {
    "there is no such port": no_port,
    "another program has it": used,
    "the bus is closed": closed,
    "the port is gone": gone,
    "no answer within": silent,
    "not asked: the unit was silent before": silent_again,
    "the CRC of the bytes is": lambda place: place.spoilt("flip_bit").read(1, 0x2100),
    "no right answer within": lambda place: place.spoilt("wrong_function").read(1, 0x2100),
    "does not fit its function": lambda place: place.spoilt("short").read(1, 0x2100, 2),
    "exception 01H": refused(0x01),
    "exception 02H": lambda place: place.bus().read(1, 0x7777),
    "exception 06H": refused(0x06),
    "the closest is": lambda place: place.drive().read("output_curent"),
    "neither a number nor a known choice": lambda place: place.drive().write("P00.01", "terminal"),
    "out of range": lambda place: place.drive().run(1000.0),
    "is shorter than the line can carry": lambda place: place.bus().poll({1: [(0x2100, 1)]}, interval=0.001),
    "is the broadcast address": lambda place: place.bus().read(0, 0x2100),
    "is the command register of": lambda place: place.drive().bus.write(1, 0x7000, 1),
    "is not a command of unit": lambda place: place.drive().bus.write(1, 0x2000, 77),
    "takes its commands from the keypad": lambda place: place.bus().drive(1).run(10.0),
    "is in fault": in_fault,
    "can be written only while the drive is stopped": lambda place: place.running().write("P00.03", 40.0),
    "this bus is read-only": lambda place: place.bus(read_only=True).drive(1).stop(),
    "was told to stop meanwhile": stopped_meanwhile,
    "the link to unit": lossy,
    "is not verified": lambda place: place.drive().write("P14.03", 10),
    "could not be identified for sure": lambda place: place.bus("vfd500").drive(1),
    "and it reports": lambda place: place.bus("gd10").drive(1, "gd350").write("P00.11", 1.0),
    "and not confirmed": lost_stop,
    "and its state does not show it": unmoved,
    "drives were proved to stop": lost_stops,
    "was not reached within": lambda place: place.running().wait_for_speed(50.0, timeout=1),
}


def test_each_row_has_its_case() -> None:
    assert sorted(ROWS) == sorted(CASES)
    assert len(ROWS) == len(re.findall(r"^\| `", PAGE, re.MULTILINE))


@pytest.mark.parametrize("said", CASES)
def test_it_is_said_so(said: str) -> None:
    if os.name == "nt" and CASES[said] in (used, gone):
        pytest.skip("no pseudo-terminal")
    with ExitStack() as stack:
        with pytest.raises(DrivebusError) as raised:
            CASES[said](Place(stack))
        assert said in str(raised.value)
        assert type(raised.value).__name__ == ROWS[said]


def test_every_error_is_explained() -> None:
    """Those that a program may catch by name, but for the bases and what only a crowd of threads can meet."""
    kinds = {name for name in drivebus.errors.__all__ if not name.endswith("Warning")}
    assert kinds - set(ROWS.values()) - {"LINE_ERRORS", "DrivebusError", "NotAllowed"} == {"QueueFull"}
