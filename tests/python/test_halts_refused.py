"""A halt of a unit that refuses it for a while, is busy, loses requests or says nothing: told until it is taken.

In virtual time, against a GD350 that a program runs. The judge is the simulated drive. `make test` has every end with
every exception and with each time for which it comes, `DRIVEBUS_MATRIX=all` all of them together.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import suppress

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, DrivebusError, Simulator

from .matrix import ALL, refusals


@pytest.fixture
def line() -> Iterator[tuple[Simulator, Bus]]:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        bus.drive(1, "gd350").prepare_control()
        bus.drive(1, "gd350").run(20.0)
        yield simulator, bus


def test_one_that_is_identified_is_told_at_once(line: tuple[Simulator, Bus]) -> None:
    simulator, bus = line
    before = len(simulator.line.trace())
    bus.drive(1, "gd350").stop()
    first = next(frame for _, who, frame in simulator.line.trace()[before:] if who == "master")
    assert first == drivebus.rtu.encode_write(1, 0x2000, 5)


ENDS = ["stop", "coast", "stop_all", "block", "exception", "jog", "jog block", "trial", "await"]


@pytest.mark.parametrize(("end", "exception", "seconds"), refusals(ENDS))
def test_a_refusal_that_ends_leaves_no_motor_running(
    line: tuple[Simulator, Bus], end: str, exception: int, seconds: float
) -> None:
    simulator, bus = line
    drive = bus.drive(1, "gd350")

    def refuse(*_: object) -> None:
        simulator.drive(1).refuse(exception, asked="writes", seconds=seconds)

    async def awaited() -> None:
        async with drivebus.aio.Bus(simulator) as other, (await other.drive(1, "gd350")).running(20.0):
            refuse()

    if end == "block":
        with drive.running(20.0):
            refuse()
    elif end == "exception":
        with suppress(ZeroDivisionError), drive.running(20.0):
            refuse()
            raise ZeroDivisionError
    elif end == "trial":
        # Its setpoint may be refused, too: then it ends early.
        with suppress(DrivebusError):
            drivebus.trial.step(drive, 20.0, 25.0, duration=0.5, max_current=None, told=refuse)
    elif end == "await":
        asyncio.run(awaited())
    elif end.startswith("jog"):
        drive.stop()
        drive.wait_until_stopped(timeout=60)
        if end == "jog":
            drive.jog()
            refuse()
            drive.jog_stop()
        else:
            with drive.jogging():
                refuse()
    else:
        refuse()
        {"stop": drive.stop, "coast": drive.coast, "stop_all": bus.stop_all}[end]()
    drive.wait_until_stopped(timeout=60)
    assert simulator.drive(1).state == "stopped"


@pytest.mark.parametrize("lost", [0.3, 0.5, 0.7, 0.85])
def test_requests_that_are_lost_leave_no_motor_running(lost: float) -> None:
    for seed in range(60 if ALL else 12):
        with (
            Simulator({1: "gd350"}, transport="process", clock="virtual", seed=seed) as simulator,
            Bus(simulator) as bus,
        ):
            drive: Drive = bus.drive(1, "gd350")
            drive.prepare_control()
            # What the line says of the proof is not what is asked here: the motor must be told.
            with suppress(DrivebusError), drive.running(20.0):
                simulator.line.set_faults(deaf=lost)
            simulator.line.clear()
            bus.sleep(60.0)
            assert simulator.drive(1).state == "stopped", f"seed {seed}"


def test_a_unit_that_stays_busy_is_told_nothing_that_could_start_it() -> None:
    """It says neither what it is nor anything else, for ever: 06H is busy (Modbus V1.1b3, section 7)."""
    with Simulator({1: "eds300"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        simulator.drive(1).refuse(0x06)
        with pytest.raises(drivebus.DrivebusError, match=r"the motor may still turn"):
            bus.drive(1, "gd350").stop()
        assert simulator.drive(1).writes() == []
        assert simulator.drive(1).state == "stopped"


def test_a_halt_that_was_refused_says_what_the_refusal_means(line: tuple[Simulator, Bus]) -> None:
    """06H of a GD350: it got a damaged frame (GD350 manual, section 9.4.7), which is no decision."""
    simulator, bus = line
    simulator.drive(1).refuse(0x06, asked="writes")
    with pytest.raises(drivebus.Refused, match="not taken") as refused:
        bus.drive(1, "gd350").stop()
    assert (refused.value.code, refused.value.means, refused.value.is_decision) == (0x06, "ask_again", False)
