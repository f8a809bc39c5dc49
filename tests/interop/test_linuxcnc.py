"""`drivebus hal` under LinuxCNC's own HAL: real halrun and halcmd, simulated drives behind pseudo-terminals.

The judge is what each drive took, by its own log. Codes and addresses are typed from the manuals: GD350, operation
manual, chapter 9.4.5; GD600, p. 140; VFD500, pp. 134 and 135, hundredths of a hertz while P30.14 says Hz. The rules
themselves are in tests/python/test_hal_core.py.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import drivebus
from drivebus.sim import SimulatedDrive, Simulator

from .conftest import TOOLS, lacking
from .halrun import Linuxcnc, Session, hal_for_us, is_running, wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="LinuxCNC is for Linux")


class Family(NamedTuple):
    command: int
    setpoint: int
    forward: int
    reverse: int
    stop: int
    reset: int
    fault: int
    options: tuple[str, ...] = ()
    timeout: int | None = None
    """Where its communication time-out is, in RAM; None: it has none that is known."""


FAMILIES = {
    "gd350": Family(0x2000, 0x2001, 1, 2, 5, 7, 11, (), 0x8E04),
    "gd600": Family(0x2000, 0x2001, 1, 2, 5, 7, 1),
    "vfd500": Family(0x7000, 0x7001, 1, 2, 6, 8, 18, ("--variant", "speed_unit=Hz"), 0x1E05),
}
UNDER_TEST = ("--format", "8N1", "--unverified")


@pytest.fixture(scope="module")
def linuxcnc() -> Linuxcnc:
    installed = shutil.which("halrun")
    root = TOOLS / "linuxcnc"
    if installed is None and not (root / "usr/bin/halrun").exists():
        lacking("LinuxCNC's halrun", "linuxcnc-uspace")
    found = Linuxcnc(root if installed is None else Path(installed).parents[2])
    if found.python is None:
        lacking("the Python that LinuxCNC's module is made for", "python3")
    return found


@pytest.fixture
def session(linuxcnc: Linuxcnc, tmp_path: Path) -> Iterator[Session]:
    with hal_for_us():
        session = Session(linuxcnc, tmp_path)
        try:
            yield session
        finally:
            session.close()


class Cell:
    """A drive that obeys the bus, and the component for it.

    Its ramps are as the factory sets them: 2.5 Hz take half a second.
    """

    def __init__(self, family: str, simulator: Simulator, session: Session) -> None:
        self.family, self.simulator, self.session = FAMILIES[family], simulator, session
        self.machine: SimulatedDrive = simulator.drive(1)
        variants = {"speed_unit": "Hz"} if self.family.options else None
        with drivebus.Bus(simulator.port, parity="N") as bus:
            drive = bus.drive(1, family, unverified=True, variants=variants)
            # Into EEPROM: of a GD600 no way to RAM alone is known.
            drive.prepare_control(store=True)
        self.words = ["--port", simulator.port, *UNDER_TEST, "--profile", family, *self.family.options]
        self.process = session.load("drivebus", *self.words, "hal", "--rpm-per-hz", "60", "--watchdog", "2")
        self.machine.take_writes()

    def on(self, rpm: float) -> None:
        self.session.set(enable=1, speed_command=rpm, spindle_on=1)

    def runs(self) -> None:
        """Turns at 150 rpm, and what was told until then is forgotten."""
        self.on(150)
        self.session.until(self.session.shows(at_speed=True))
        self.machine.take_writes()

    def taken(self) -> list[tuple[str, int]]:
        """Commands and setpoints that the drive took since it was asked last."""
        names = {self.family.command: "command", self.family.setpoint: "setpoint"}
        return [(names[address], value) for _, address, value in self.machine.take_writes() if address in names]

    def was_stopped(self) -> bool:
        """Whether the drive took a stop, and nothing else. On a busy machine one whose answer is late is sent again."""
        return set(self.taken()) == {("command", self.family.stop)}

    def ends(self) -> None:
        """The component ends, and has stopped what it ran."""
        wait_until(lambda: not is_running(self.process), self.session.log.read_text)
        assert self.was_stopped()
        wait_until(lambda: self.machine.state == "stopped", lambda: self.machine)


@pytest.fixture
def cell(session: Session) -> Iterator[Cell]:
    with Simulator({1: "gd350"}, parity="N") as simulator:
        yield Cell("gd350", simulator, session)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_job_of_a_spindle_of_each_family(family: str, session: Session) -> None:
    with Simulator({1: family}, parity="N") as simulator:
        cell = Cell(family, simulator, session)
        codes, set_, until, shows = cell.family, session.set, session.until, session.shows
        until(shows(ready=True, stopped=True, brake=True, link_ok=True, initialized=True))
        assert cell.taken() == []

        cell.on(150)
        until(shows(at_speed=True, forward=True, stopped=False, brake=False, speed_feedback=150, frequency_out=2.5))
        assert sorted(cell.taken()) == [("command", codes.forward), ("setpoint", 250)]
        if codes.timeout is not None:
            assert cell.machine.register(codes.timeout & 0x7FFF) == 20  # tenths of a second

        set_(speed_command=-90)
        until(shows(at_speed=True, reverse=True, forward=False, speed_feedback=-90))
        assert sorted(cell.taken()) == [("command", codes.reverse), ("setpoint", 150)]

        set_(spindle_on=0)
        until(shows(stopped=True, brake=True, at_speed=False))
        assert cell.was_stopped()

        set_(spindle_on=1)
        until(shows(at_speed=True))
        cell.taken()
        cell.machine.trip(codes.fault)
        until(shows(fault=True, fault_code=codes.fault, ready=False, at_speed=False))
        # A drive that is still told to run may start when it is reset.
        until(lambda: cell.machine.writes())
        assert cell.was_stopped()
        set_(spindle_on=0, reset=1)
        until(shows(fault=False, ready=True))
        assert cell.taken() == [("command", codes.reset)]

        set_(reset=0, spindle_on=1)
        until(shows(at_speed=True))
        cell.taken()
        set_(enable=0)
        until(shows(stopped=True))
        set_(enable=1)  # and it does not start again by itself
        until(shows(ready=False, brake=True))
        assert cell.was_stopped()

        set_(spindle_on=0)
        until(shows(ready=True))
        cell.runs()
        session.halcmd("unloadusr", "drivebus")
        cell.ends()
        if codes.timeout is not None:
            assert cell.machine.register(codes.timeout & 0x7FFF) == 0


def test_the_end_of_halrun_stops_the_motor(cell: Cell) -> None:
    cell.runs()
    cell.session.end()
    cell.ends()


def test_kill_9_of_hal_stops_the_motor(cell: Cell) -> None:
    cell.runs()
    for process in cell.session.processes():
        os.kill(process, signal.SIGKILL)
    cell.ends()
    assert "nobody else is left on HAL's memory" in cell.session.log.read_text()


def test_the_end_of_the_real_time_side_stops_the_motor(session: Session, tmp_path: Path) -> None:
    """A program of its name stands for it: what it is looked for by."""
    sleep = shutil.which("sleep")
    assert sleep is not None
    shutil.copy(sleep, tmp_path / "rtapi_app")
    # halrun does not begin where one runs already.
    session.until(session.is_up)
    with (
        Simulator({1: "gd350"}, parity="N") as simulator,
        subprocess.Popen([tmp_path / "rtapi_app", "1000"]) as realtime,
    ):
        try:
            cell = Cell("gd350", simulator, session)
            cell.runs()
        finally:
            realtime.kill()
        cell.ends()
    assert "rtapi_app" in session.log.read_text()


def test_kill_9_of_the_component_leaves_the_stop_to_the_drive(cell: Cell) -> None:
    """P14.04 and P14.05 of the GD350, GD300 manual, p. 122: after two seconds of silence it stops by its ramp."""
    cell.runs()
    os.kill(cell.process, signal.SIGKILL)
    wait_until(lambda: cell.machine.state == "stopped", lambda: cell.machine)
    assert (cell.taken(), cell.machine.fault) == ([], 0)


def test_a_second_component_of_the_same_name_says_so(cell: Cell, linuxcnc: Linuxcnc) -> None:
    command = linuxcnc.command(*cell.words, "hal", "--rpm-per-hz", "60")
    done = subprocess.run(command.split(), env=linuxcnc.env, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "HAL does not take a component drivebus" in done.stderr
    assert is_running(cell.process)


def test_one_hal_has_several_spindles(cell: Cell) -> None:
    with Simulator({1: "gd350"}, parity="N") as simulator:
        words = ["--port", simulator.port, *UNDER_TEST, "--profile", "gd350"]
        other = cell.session.load("other", *words, "hal", "--rpm-per-hz", "30", "--no-watchdog")
        cell.runs()
        assert cell.session.halcmd("getp", "other.stopped") == "TRUE"
        cell.session.end()
        cell.ends()
        wait_until(lambda: not is_running(other), cell.session.log.read_text)
        assert simulator.drive(1).words_written == 0
