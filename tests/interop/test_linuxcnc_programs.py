"""`drivebus hal` beside the programs that LinuxCNC has for drives of the same families: one HAL script, two drives.

Each program has a simulated drive of its own, behind a pseudo-terminal of its own. The judge is that drive: what it was
told, which way its motor turns and how fast, and whether it stands in the end. Each word is typed from the page that
its comment names; what the other program sends was not looked up, but heard.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

import drivebus
from drivebus import tables
from drivebus.sim import SimulatedDrive, Simulator

from .halrun import Session, wait_until
from .test_linuxcnc import UNDER_TEST, linuxcnc, session

__all__ = ["linuxcnc", "session"]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="LinuxCNC is for Linux")

BAUD = 19_200
RPM_PER_HZ = 60
"""A motor of two poles, as each program is told, too."""

Place = int


class Program(NamedTuple):
    """A program of LinuxCNC's own, and the family that it drives.

    Attributes:
        family: As drivebus calls it.
        line: How it is loaded; `{port}` is where its drive is, `{ini}` a file with that.
        name: What HAL calls it.
        speed: Its pin for the speed.
        starts: Its pin that starts and stops.
        enables: Its pin that lets it, if it has one.
        runs: The words that run the motor forward, the run itself first: where, and which.
        setpoint: Where the speed is set.
        counts: The words for 2.5 Hz and for 1.5 Hz, in the scale of the family.
        stops: The words by which it may be stopped: of drivebus, and of the program.
        settings: Pins that are set once: the address of the unit.
        halts: Its pin that stops, if that is another.
        per_hertz: What its pin for the speed counts: revolutions a minute, tenths of a hertz, or hertz.
        adds: What it puts on top of the speed while the motor turns.
    """

    family: str
    line: str
    name: str
    speed: str
    starts: str
    enables: str | None
    runs: tuple[tuple[Place, int], ...]
    setpoint: Place
    counts: tuple[int, int]
    stops: tuple[tuple[Place, int], tuple[Place, int]]
    settings: tuple[tuple[str, int], ...] = ()
    halts: str | None = None
    per_hertz: int = RPM_PER_HZ
    adds: int = 0


RUN, DIRECTION = tables.place("coil", 0x0000), tables.place("coil", 0x0001)

FORWARD, STOP = tables.place("coil", 0x0049), tables.place("coil", 0x004B)

USUAL = "-S 3000 -F 50 -f 1 -d {port} -r 19200 -p none -s 1 -t 1"

PROGRAMS = {
    # A Delta drive is stopped by bit 0 of 2000H (VFD-ED manual, p. 440); the program keeps the bits of the direction.
    "vfdb_vfd": Program(
        "vfd-e", "vfdb_vfd -n other -I {ini}", "other", "speed-command", "spindle-on", "enable",
        ((0x2000, 0x12),), 0x2001, (250, 150), ((0x2000, 0x01), (0x2000, 0x11)),
    ),
    # SVD-PS, of the class of the MD500, whose 10000 counts are F0-10: drivebus stops by 6, along the ramp, the program
    # by 5, at which a drive of this class lets its motor coast (MD500 manual, p. 226).
    "svd-ps_vfd": Program(
        "md500", f"svd-ps_vfd {USUAL}", "svd-ps_vfd", "speed-cmd", "spindle-on", None,
        ((0x2000, 1),), 0x1000, (500, 300), ((0x2000, 6), (0x2000, 5)),
    ),
    # The run is a coil, and beside it stands another for the direction (WJ200 manual, p. B-24).
    "wj200_vfd": Program(
        "wj200", "wj200_vfd --device {port} --baud 19200 --parity n --databits 8 --stopbits 1 names=wj200_vfd",
        "wj200_vfd", "commanded-frequency", "run", "enable",
        ((RUN, 1), (DIRECTION, 0)), 0x0001, (250, 150), ((RUN, 0), (RUN, 0)), (("mbslaveaddr", 1),), per_hertz=1,
    ),
    # Huanyang's own protocol: 03 runs forward by 01H and stops by 08H, 05 sets the frequency in 0.01 Hz (Dema D5M
    # manual, pp. 71 and 72). Its highest frequency is 50 Hz from the factory; the program writes PD144.
    "hy_vfd": Program(
        "huanyang-hy", "hy_vfd -n hy_vfd -d {port} -r 19200 -p none -s 1 -t 1 -S 3000", "hy_vfd",
        "speed-command", "spindle-on", "enable",
        ((0x0300, 0x01),), 0x0500, (250, 150), ((0x0300, 0x08), (0x0300, 0x08)), (("spindle-forward", 1),), adds=1,
    ),
    # None is made for an H100: whoever has LinuxCNC writes its registers down for mb2hal. Coil 0049H runs forward,
    # 004BH stops, 0201H counts 0.1 Hz (FluidNC, H100Spindle.md). mb2hal writes each of them over and over.
    "mb2hal": Program(
        "h100", "mb2hal config={ini}", "mb2hal", "speed.00.float", "forward.00.bit", None,
        ((FORWARD, 1),), 0x0201, (25, 15), ((STOP, 1), (STOP, 1)), halts="stop.00.bit", per_hertz=10,
    ),
}  # fmt: skip

VFD_B = """\
[VFD-B]
DEVICE={port}
BAUD={baud}
BITS=8
PARITY=None
STOPBITS=1
TARGET=1
POLLCYCLES=2
RECONNECT_DELAY=1
MOTOR_HZ=50
MOTOR_RPM=3000
"""
MB2HAL = """\
[MB2HAL_INIT]
VERSION=1.1
HAL_MODULE_NAME=mb2hal
TOTAL_TRANSACTIONS=3

[TRANSACTION_00]
LINK_TYPE=serial
SERIAL_PORT={port}
SERIAL_BAUD={baud}
SERIAL_BITS=8
SERIAL_PARITY=none
SERIAL_STOP=1
MB_SLAVE_ID=1
MB_RESPONSE_TIMEOUT_MS=500
MB_TX_CODE=fnct_06_write_single_register
HAL_TX_NAME=speed
FIRST_ELEMENT=513
NELEMENTS=1

[TRANSACTION_01]
MB_TX_CODE=fnct_05_write_single_coil
HAL_TX_NAME=forward
FIRST_ELEMENT=73
NELEMENTS=1

[TRANSACTION_02]
MB_TX_CODE=fnct_05_write_single_coil
HAL_TX_NAME=stop
FIRST_ELEMENT=75
NELEMENTS=1
"""
FILES = {"vfdb_vfd": VFD_B, "mb2hal": MB2HAL}
"""What `{ini}` holds, where a program is told by a file."""


class Shown(NamedTuple):
    """What a drive did under one program."""

    states: list[tuple[str, float]]
    """Its state, and its frequency, behind each step of the script."""

    told: set[tuple[Place, int]]


def carried_out(machine: SimulatedDrive, set_: Callable[[str, float], None], per_hertz: int) -> Shown:
    """The script: on at 2.5 Hz, then 1.5 Hz, then off; *set_* sets a pin by what it is for."""
    states: list[tuple[str, float]] = []

    def until(state: str, hertz: float) -> None:
        wait_until(lambda: (machine.state, round(machine.frequency, 2)) == (state, hertz), lambda: machine)
        states.append((machine.state, round(machine.frequency, 2)))

    machine.take_writes()
    set_("enable", 1)
    set_("speed", 2.5 * per_hertz)
    set_("on", 1)
    until("forward", 2.5)
    set_("speed", 1.5 * per_hertz)
    until("forward", 1.5)
    set_("on", 0)
    until("stopped", 0.0)
    return Shown(states, {(place, word) for _, place, word in machine.take_writes()})


@pytest.fixture
def line(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    """A drive of the family that obeys the bus."""
    family = PROGRAMS[request.node.callspec.params["name"]].family
    with Simulator({1: family}, parity="N", baudrate=BAUD) as simulator:
        yield simulator


def prepare(simulator: Simulator, program: Program) -> SimulatedDrive:
    """Has the drive obey the bus, as its keypad would."""
    with drivebus.Bus(simulator.port, parity="N", baudrate=BAUD) as bus:
        bus.drive(1, program.family, unverified=True).prepare_control(store=True)
    return simulator.drive(1)


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_same_script_makes_the_motor_do_the_same(
    name: str, session: Session, line: Simulator, tmp_path: Path
) -> None:
    program = PROGRAMS[name]
    if not session.has(name):
        pytest.skip(f"this LinuxCNC has no {name}")

    machine = prepare(line, program)
    words = ["--port", line.port, *UNDER_TEST, "--baud", str(BAUD), "--profile", program.family]
    session.load("drivebus", *words, "hal", "--rpm-per-hz", str(RPM_PER_HZ))
    pins = {"enable": "enable", "speed": "speed-command", "on": "spindle-on"}
    ours = carried_out(machine, lambda pin, value: session.setp("drivebus", pins[pin], value), RPM_PER_HZ)
    session.unload("drivebus")

    with Simulator({1: program.family}, parity="N", baudrate=BAUD) as simulator:
        machine = prepare(simulator, program)
        ini = tmp_path / "drive.ini"
        ini.write_text(FILES.get(name, "").format(port=simulator.port, baud=BAUD))
        session.load_other(program.name, program.line.format(port=simulator.port, ini=ini))
        for pin, value in program.settings:
            session.setp(program.name, pin, value)

        def set_(pin: str, value: float) -> None:
            if pin == "speed":
                session.setp(program.name, program.speed, value - program.adds)
            elif pin == "enable":
                if program.enables is not None:
                    session.setp(program.name, program.enables, value)
            elif program.halts is not None and value:
                # First what stops is let go: it is said over and over.
                session.setp(program.name, program.halts, 0)
                session.setp(program.name, program.starts, 1)
            else:
                session.setp(program.name, program.starts, value)
                if program.halts is not None:
                    session.setp(program.name, program.halts, 1)

        # Not each of them ends when it is told to: the session ends it.
        theirs = carried_out(machine, set_, program.per_hertz)

    assert ours.states == theirs.states
    setpoints = {(program.setpoint, count) for count in program.counts}
    assert ours.told == {*program.runs, *setpoints, program.stops[0]}
    # What else it sends, at rest, or of a direction that is so already, moves no motor.
    assert {program.runs[0], *setpoints, program.stops[1]} <= theirs.told
