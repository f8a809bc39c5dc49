"""The loop of `drivebus hal` against simulated drives, in virtual time: only HAL is not there, a dict stands for it.

What the drive took is its own log. GD350: 2000H takes 1 forward, 2 reverse, 5 stop, 6 coast, 7 reset, and 2001H
hundredths of a hertz (operation manual, chapter 9.4.5). LinuxCNC itself is in tests/interop/test_linuxcnc.py.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, Simulator
from drivebus.hal import PINS, Alive, HalGone, Loop, Pins, Scale, Spindle, SpindleMotor, module
from drivebus.hal.core import Action
from drivebus.hal.loop import Watch

COMMAND, SETPOINT = 0x2000, 0x2001
FORWARD, REVERSE, STOP, COAST, RESET = 1, 2, 5, 6, 7
TIMEOUT, ACTION, RAM = 0x0E04, 0x0E05, 0x8000
OL1 = 11


class Cell:
    """A component of HAL's with the loop behind it."""

    def __init__(
        self, simulator: Simulator, drive: Drive, watchdog: float | None = None, watch: Watch | None = None
    ) -> None:
        self.pins: dict[str, bool | float] = {name: kind == "FLOAT" and 0.0 for name, (kind, _) in PINS.items()}
        self.said: list[str] = []
        self.simulator, self.machine = simulator, simulator.drive(1)
        self.motor = SpindleMotor(drive, watchdog, self.said.append)
        self.spindle = Spindle(Scale(60.0))
        self.watch = watch
        self.loop = Loop(Pins(self.pins), self.spindle, self.motor, drive, self.said.append, watch)
        self.machine.take_writes()
        self.pins["enable"] = True
        self.loop.cycle()

    def until(self, reached: Callable[[], object], seconds: float = 60.0) -> None:
        """Cycles until it is so; *seconds* of the line's clock end a test that failed."""
        deadline = self.simulator.now() + seconds
        while not reached():
            assert self.simulator.now() < deadline, (self.pins, self.said)
            self.loop.cycle()
            self.simulator.advance(0.03)

    def shows(self, **pins: bool | float) -> Callable[[], bool]:
        return lambda: all(self.pins[name.replace("_", "-")] == value for name, value in pins.items())

    def on(self, rpm: float) -> None:
        self.pins |= {"spindle-on": True, "speed-command": rpm}

    def taken(self) -> list[tuple[int, int]]:
        return [(address, value) for _, address, value in self.machine.take_writes()]


@pytest.fixture
def cell(virtual: Simulator, virtual_drive: Drive) -> Cell:
    virtual_drive.write({"P00.11": 2.0, "P00.12": 2.0})  # seconds from standstill to 50 Hz, and back
    return Cell(virtual, virtual_drive)


def test_a_job_as_the_drive_took_it(cell: Cell) -> None:
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True, forward=True))
        assert cell.taken() == [(COMMAND, FORWARD), (SETPOINT, 2000)]
        assert (cell.pins["speed-feedback"], cell.pins["frequency-out"]) == (1200.0, 20.0)
        cell.pins["speed-command"] = 1500.0
        cell.until(cell.shows(at_speed=True, frequency_out=25.0))
        assert cell.taken() == [(SETPOINT, 2500)]
        cell.pins["speed-command"] = -600.0
        cell.until(cell.shows(at_speed=True, reverse=True))
        assert cell.taken() == [(COMMAND, REVERSE), (SETPOINT, 1000)]
        assert cell.pins["speed-feedback"] == -600.0
        cell.pins["spindle-on"] = False
        cell.until(cell.shows(stopped=True, brake=True))
        assert cell.taken() == [(COMMAND, STOP)]
    assert cell.taken() == []
    assert (cell.pins["error-count"], cell.said) == (0, [])


def test_switched_off_the_machine_stops_at_once(cell: Cell) -> None:
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True))
        cell.taken()
        cell.pins["enable"] = False
        cell.loop.cycle()
        assert cell.taken() == [(COMMAND, STOP)]
        cell.until(cell.shows(stopped=True))
        cell.pins["enable"] = True
        for _ in range(10):
            cell.loop.cycle()
        assert cell.taken() == []


def test_a_trip_is_told_and_reset(cell: Cell) -> None:
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True))
        cell.taken()
        cell.machine.trip(OL1)
        cell.until(cell.shows(fault=True, fault_code=OL1, at_speed=False))
        cell.loop.cycle()
        assert cell.taken() == [(COMMAND, STOP)]
        cell.pins |= {"spindle-on": False, "reset": True}
        cell.until(cell.shows(fault=False, ready=True))
        assert cell.taken() == [(COMMAND, RESET)]


@pytest.mark.parametrize(
    "error", [KeyboardInterrupt(), HalGone("gone"), SystemExit(143), ValueError("a mistake of ours")]
)
def test_whatever_ends_it_stops_the_motor_once(cell: Cell, error: BaseException) -> None:
    def work() -> None:
        with cell.motor:
            cell.on(1200.0)
            cell.until(cell.shows(at_speed=True))
            cell.taken()
            raise error

    with pytest.raises(type(error)):
        work()
    assert cell.taken() == [(COMMAND, STOP)]


def test_what_was_not_started_here_is_left_alone(cell: Cell, virtual_drive: Drive) -> None:
    virtual_drive.run(10.0)
    cell.taken()
    with cell.motor:
        cell.until(cell.shows(forward=True))
        cell.pins["enable"] = False
        cell.loop.cycle()
    assert cell.taken() == []


def test_a_refused_start_is_told_and_not_repeated(virtual: Simulator, virtual_bus: Bus) -> None:
    """As the factory sets it: commands from the keypad."""
    cell = Cell(virtual, virtual_bus.drive(1))
    with cell.motor:
        cell.on(1200.0)
        for _ in range(10):
            cell.loop.cycle()
        assert (cell.taken(), cell.pins["fault"], cell.pins["fault-code"]) == ([], True, 0)
        [said] = cell.said
        assert "keypad" in said


def test_a_silent_drive_is_told_to_stop_and_the_pins_say_so(cell: Cell, virtual: Simulator) -> None:
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True))
        cell.taken()
        virtual.line.drop_answers(10_000)
        cell.until(cell.shows(link_ok=False, at_speed=False, stopped=False, fault=True))
        cell.loop.cycle()
        # Nothing is heard of it, but it hears: a stop that is not confirmed is sent again, and every fourth is a coast.
        assert cell.taken()[:8] == ([(COMMAND, STOP)] * 3 + [(COMMAND, COAST)]) * 2
        virtual.line.drop_answers(0)
        cell.until(cell.shows(link_ok=True, stopped=True))
        for _ in range(10):
            cell.loop.cycle()
        assert cell.taken() == []


def test_a_stop_that_was_not_confirmed_is_sent_once_more_at_the_end(cell: Cell, virtual: Simulator) -> None:
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True))
        cell.taken()
        virtual.line.drop_answers(10_000)
        cell.pins["spindle-on"] = False
        cell.loop.cycle()
        assert cell.taken()[:8] == ([(COMMAND, STOP)] * 3 + [(COMMAND, COAST)]) * 2
        assert cell.pins["fault"] is True
        virtual.line.drop_answers(0)
    assert cell.taken() == [(COMMAND, STOP)]
    assert cell.motor.unstopped == ""


@pytest.fixture
def watched(virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive) -> Cell:
    """With a watchdog that takes so long that its thread, which keeps real time, never wakes up."""
    assert virtual_drive.check_control()
    return Cell(virtual, virtual_bus.drive(1, unverified=True), watchdog=40.0)


def test_the_drives_own_watchdog_is_set_before_the_first_start_and_given_back(watched: Cell) -> None:
    cell = watched
    with cell.motor:
        assert cell.taken() == []
        cell.on(1200.0)
        cell.until(cell.shows(forward=True))
        taken = [(address & ~RAM, value) for address, value in cell.taken()]
        # 3 stops by the ramp, tenths of a second.
        assert taken == [(ACTION, 3), (TIMEOUT, 400), (COMMAND, FORWARD), (SETPOINT, 2000)]
        cell.pins["spindle-on"] = False
        cell.until(cell.shows(stopped=True))
        cell.on(600.0)
        cell.until(cell.shows(forward=True))
        assert cell.taken() == [(COMMAND, STOP), (COMMAND, FORWARD), (SETPOINT, 1000)]
    cell.motor.give_back()
    assert (cell.machine.register(TIMEOUT), cell.machine.register(ACTION)) == (0, 0)


def test_a_drive_that_was_away_has_its_watchdog_set_again(watched: Cell, virtual_drive: Drive) -> None:
    cell = watched
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(forward=True))
        # Switched off and on: what was in its RAM is lost, also that it obeys the bus.
        cell.machine.power_cycle()
        cell.simulator.line.drop_answers(10_000)
        cell.until(cell.shows(link_ok=False))
        cell.loop.cycle()
        cell.simulator.line.drop_answers(0)
        cell.pins["spindle-on"] = False
        cell.until(cell.shows(stopped=True))
        virtual_drive.prepare_control()
        assert cell.machine.register(TIMEOUT) == 0
        cell.on(1200.0)
        cell.until(cell.shows(forward=True))
        assert (cell.machine.register(TIMEOUT), cell.machine.register(ACTION)) == (400, 3)
    cell.motor.give_back()


def test_the_brake_opens_before_the_motor_starts(cell: Cell) -> None:
    at_the_start: list[object] = []
    carry_out = cell.motor.carry_out

    def told(action: Action) -> None:
        at_the_start.append((cell.pins["brake"], cell.machine.state))
        carry_out(action)

    assert cell.pins["brake"] is True
    cell.motor.carry_out = told  # type: ignore[method-assign]
    with cell.motor:
        cell.on(1200.0)
        cell.loop.cycle()
    assert at_the_start == [(False, "stopped")]


def test_a_drive_that_is_switched_on_later(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual.line.drop_answers(10_000)
    cell = Cell(virtual, virtual_drive)
    assert (cell.pins["initialized"], cell.pins["link-ok"], cell.pins["brake"]) == (False, False, False)
    virtual.line.drop_answers(0)
    cell.until(cell.shows(initialized=True, link_ok=True, ready=True, brake=True))


def test_a_watchdog_that_is_not_verified_is_for_who_starts_it_to_decide(
    virtual: Simulator, virtual_drive: Drive
) -> None:
    with pytest.raises(drivebus.NotAllowed, match=r"P14\.04.*--unverified.*--no-watchdog"):
        Cell(virtual, virtual_drive, watchdog=2.0)


@pytest.mark.parametrize(
    ("family", "says"), [("gd600", "no communication time-out"), ("vfd500", "whether its motor then stops")]
)
def test_what_no_watchdog_can_do_is_said(family: str, says: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        cell = Cell(simulator, bus.drive(1, family, unverified=True, variants=None), watchdog=40.0)
        [said] = cell.said
        assert says in said


def test_a_family_without_a_setpoint_in_hertz_is_no_spindle() -> None:
    rectifier = Simulator({1: "gd600-rectifier"}, transport="process", clock="virtual")
    with rectifier, Bus(rectifier) as bus, pytest.raises(drivebus.NotAllowed, match="setpoint"):
        Cell(rectifier, bus.drive(1, "gd600-rectifier", unverified=True))


def proc(folder: Path, processes: dict[int, tuple[str, str]], attached: int | None) -> Path:
    """What the system tells of its processes, and of HAL's memory, whose key is 48414C32H."""
    for process, (name, state) in processes.items():
        (folder / str(process)).mkdir(parents=True, exist_ok=True)
        (folder / str(process) / "stat").write_text(f"{process} ({name}) {state} 1 1\n")
    (folder / "sysvipc").mkdir(parents=True, exist_ok=True)
    row = "" if attached is None else f" 1212238898  7   600  1048576 17630 17740 {attached}  0  0\n"
    (folder / "sysvipc" / "shm").write_text(f"   key  shmid perms   size  cpid  lpid nattch   uid   gid\n{row}")
    return folder


def test_hal_is_gone_when_its_real_time_side_has_ended(tmp_path: Path) -> None:
    alive = Alive(proc(tmp_path, {7: ("rtapi_app", "S"), 8: ("rtapi_apple", "S")}, 3))
    assert [alive.gone(1.0, turning=True), alive.gone(2.0, turning=True)] == ["", ""]
    proc(tmp_path, {7: ("rtapi_app", "Z")}, 3)
    assert alive.gone(2.1, turning=True) == ""  # looked at four times a second
    assert "rtapi_app" in alive.gone(3.0, turning=False)


def test_hal_is_gone_when_its_memory_is(tmp_path: Path) -> None:
    alive = Alive(proc(tmp_path, {}, 2))
    assert alive.gone(1.0, turning=False) == ""
    proc(tmp_path, {}, None)
    assert "memory was removed" in alive.gone(2.0, turning=False)


def test_who_is_alone_with_a_motor_that_turns_waits_for_two_seconds(tmp_path: Path) -> None:
    alive = Alive(proc(tmp_path, {}, 1))
    assert [alive.gone(float(now), turning=False) for now in range(5)] == [""] * 5
    assert [bool(alive.gone(float(now), turning=True)) for now in (10, 11, 12)] == [False, False, True]


def test_a_system_that_tells_nothing_ends_nothing(tmp_path: Path) -> None:
    alive = Alive(tmp_path / "nowhere")
    assert [alive.gone(float(now), turning=True) for now in range(5)] == [""] * 5


def test_the_module_of_another_python_is_named(tmp_path: Path) -> None:
    (tmp_path / "hal.py").write_text("import _hal\n")
    (tmp_path / "_hal.cpython-27-x86_64-linux-gnu.so").touch()
    with pytest.raises(drivebus.NotAllowed, match=r"_hal\.cpython-27.*this is Python"):
        module(str(tmp_path))


def test_a_module_that_is_not_there_is_told_where_to_get(tmp_path: Path) -> None:
    with pytest.raises(drivebus.NotAllowed, match=r"linuxcnc-uspace.*--hal-path"):
        module(str(tmp_path))


def test_a_drive_that_counts_shares_of_a_frequency_gets_whole_counts() -> None:
    """V20: 047EH, then 047FH or 0C7FH at 0063H, and 16384 counts at 0064H are 50 Hz: 20 Hz are 6553.6 of them."""
    with Simulator({1: "v20"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        cell = Cell(simulator, bus.drive(1, "v20", unverified=True, variants={"base_frequency": "50 Hz"}))
        with cell.motor:
            cell.on(1200.0)
            cell.until(cell.shows(at_speed=True, forward=True))
            assert cell.taken() == [(0x63, 0x047E), (0x63, 0x047F), (0x64, 6554)]
            cell.pins["speed-command"] = 1000.0
            cell.until(lambda: cell.pins["at-speed"] and abs(float(cell.pins["frequency-out"]) - 1000 / 60) < 0.02)
            assert cell.taken() == [(0x64, 5461)]
            cell.pins["spindle-on"] = False
            cell.until(cell.shows(stopped=True))
            assert cell.taken() == [(0x63, 0x047E)]
        assert cell.said == []
