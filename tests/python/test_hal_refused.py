"""`drivebus hal` leaves no spindle running whose drive refuses for a while to be halted, at whichever end.

In virtual time, and as in `test_hal_loop` only HAL is not there. The exceptions are those of the Modbus specification
(V1.1b3, section 7), of which some say that they pass and others that they do not: a motor is told to stop all the same.
`make test` has every end with every exception and with each time, `DRIVEBUS_MATRIX=all` all of them together.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import pytest

from drivebus import Drive, Simulator
from drivebus.hal import HalGone

from .matrix import ALL, refusals
from .test_hal_loop import COAST, COMMAND, STOP, Cell


class Mistake(Exception):
    """One of ours."""


class Hal:
    """LinuxCNC's HAL, as far as the component looks whether it is there."""

    is_gone = False

    def gone(self, _: float, *, turning: bool) -> str:
        return "gone" if self.is_gone and turning else ""


def spindle_off(cell: Cell) -> None:
    cell.pins["spindle-on"] = False
    cell.until(cell.shows(stopped=True))


def emergency_stop(cell: Cell) -> None:
    cell.pins["enable"] = False
    cell.until(cell.shows(stopped=True))


def unload(_: Cell) -> None:
    raise SystemExit(143)  # what SIGTERM raises in the block


def linuxcnc_gone(cell: Cell) -> None:
    assert isinstance(cell.watch, Hal)
    cell.watch.is_gone = True
    cell.until(lambda: False)


def mistake(_: Cell) -> None:
    raise Mistake


ENDS: dict[str, Callable[[Cell], None]] = {
    "spindle off": spindle_off,
    "emergency stop": emergency_stop,
    "unload": unload,
    "LinuxCNC gone": linuxcnc_gone,
    "a mistake": mistake,
}


@pytest.fixture
def turning(virtual: Simulator, virtual_drive: Drive) -> Cell:
    virtual_drive.write({"P00.11": 2.0, "P00.12": 2.0})
    return Cell(virtual, virtual_drive, watch=Hal())


def refused(cell: Cell, since: float) -> set[int]:
    """By which exceptions the drive refused anything *since* then."""
    frames = [frame for at, who, frame in cell.simulator.line.trace() if at >= since and who == "unit"]
    return {frame[2] for frame in frames if frame[1] & 0x80}


@pytest.mark.parametrize("asked", ["writes", "anything"] if ALL else ["writes"])
@pytest.mark.parametrize(("end", "exception", "seconds"), refusals([*ENDS]))
def test_no_end_leaves_the_spindle_running(turning: Cell, end: str, exception: int, seconds: float, asked: str) -> None:
    cell = turning
    with suppress(SystemExit, HalGone, Mistake), cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True))
        cell.taken()
        since = cell.simulator.now()
        cell.machine.refuse(exception, asked=asked, seconds=seconds)
        ENDS[end](cell)
    cell.simulator.advance(60.0)
    assert refused(cell, since) == {exception}
    assert cell.machine.state == "stopped", cell.said
    # What takes no stop is told to coast now and then.
    assert {word for _, word in cell.taken()} <= {STOP, COAST}
    assert cell.motor.unstopped == ""


@pytest.mark.parametrize("exception", range(0x01, 0x0C))
def test_a_turn_that_is_refused_ends_the_run(turning: Cell, exception: int) -> None:
    cell = turning
    with cell.motor:
        cell.on(1200.0)
        cell.until(cell.shows(at_speed=True))
        cell.taken()
        cell.machine.refuse(exception, asked="writes", seconds=2.0)
        cell.pins["speed-command"] = -1200.0
        cell.until(cell.shows(stopped=True))
        assert cell.taken() == [(COMMAND, STOP)]
