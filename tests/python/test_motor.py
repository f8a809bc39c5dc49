"""A motor inside one block, started and stopped more than once: what the drive was told, and who stops it in the end.

GD350: 2000H takes 1 forward, 2 reverse, 5 stop, 6 coast, and 2001H hundredths of a hertz (operation manual, chapter
9.4.5).
"""

from __future__ import annotations

import asyncio

import pytest

import drivebus
import drivebus.aio
from drivebus import Drive, Simulator

COMMAND, SETPOINT = 0x2000, 0x2001
FORWARD, REVERSE, STOP, COAST = 1, 2, 5, 6


def told(simulator: Simulator) -> list[int]:
    """The commands that the drive took, in order."""
    return [value for _, address, value in simulator.drive(1).take_writes() if address == COMMAND]


@pytest.fixture(autouse=True)
def drive(virtual: Simulator, virtual_drive: Drive) -> Drive:
    virtual_drive.write({"P00.11": 1.0, "P00.12": 1.0})
    virtual.drive(1).take_writes()
    return virtual_drive


def test_it_is_started_and_stopped_as_often_as_wanted(virtual: Simulator, drive: Drive) -> None:
    with drive.motor() as motor:
        assert not motor.may_turn
        motor.run(10.0)
        motor.run(20.0, reverse=True)
        assert motor.may_turn
        motor.stop()
        assert not motor.may_turn
        assert told(virtual) == [FORWARD, REVERSE, STOP]
        motor.run(5.0)
    assert told(virtual) == [FORWARD, STOP]
    assert (motor.may_turn, motor.unstopped) == (False, None)


def test_what_ends_the_block_stops_it(virtual: Simulator, drive: Drive) -> None:
    def work() -> None:
        with drive.motor() as motor:
            motor.run(10.0)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        work()
    assert told(virtual) == [FORWARD, STOP]


def test_a_block_that_starts_nothing_sends_nothing(virtual: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    told(virtual)
    with drive.motor():
        pass
    with pytest.raises(ZeroDivisionError), drive.motor():
        raise ZeroDivisionError
    assert told(virtual) == []


def test_what_somebody_else_started_may_be_stopped_too(virtual: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    with drive.motor() as motor:
        motor.stop()
        assert told(virtual) == [FORWARD, STOP]
    assert told(virtual) == []


def test_outside_its_block_nothing_is_started(virtual: Simulator, drive: Drive) -> None:
    motor = drive.motor()
    for _ in range(2):
        with pytest.raises(drivebus.NotAllowed, match=r"inside its block.*nothing was sent"):
            motor.run(10.0)
        with motor, pytest.raises(drivebus.NotAllowed, match="entered already"):
            motor.__enter__()
    assert told(virtual) == []


def test_a_start_that_was_refused_is_no_start(virtual: Simulator, drive: Drive) -> None:
    with drive.motor() as motor:
        with pytest.raises(drivebus.NotAllowed, match="allowed is 0"):
            motor.run(999.0)
        assert not motor.may_turn
        motor.run(10.0)
    assert told(virtual) == [FORWARD, STOP]


@pytest.mark.parametrize("first", range(1, 10))
def test_a_start_of_which_nothing_is_known_is_stopped(virtual: Simulator, drive: Drive, first: int) -> None:
    """From the n-th answer on, twelve are lost."""
    error: drivebus.DrivebusError | None = None
    with drive.motor() as motor:
        virtual.line.script([(first + number, "silence") for number in range(12)])
        try:
            motor.run(10.0)
        except drivebus.DrivebusError as reason:
            error = reason
        commands = told(virtual)
        assert (FORWARD in commands) is (error is None or isinstance(error, drivebus.Unconfirmed))
        assert not commands or (commands[-1] == STOP) is (error is not None)
        assert motor.may_turn is (error is None)
    assert told(virtual)[:1] == ([STOP] if error is None else [])


def test_a_stop_that_was_not_taken_is_sent_again_when_the_block_ends(virtual: Simulator, drive: Drive) -> None:
    with drive.motor(stop_within=0.5) as motor:
        motor.run(10.0)
        told(virtual)
        virtual.line.drop_answers(10_000)
        with pytest.raises(drivebus.Unconfirmed):
            motor.stop()
        assert motor.may_turn
        assert isinstance(motor.unstopped, drivebus.Unconfirmed)
        virtual.line.drop_answers(0)
        assert set(told(virtual)) == {STOP, COAST}
    assert told(virtual) == [STOP]
    assert motor.unstopped is None


def test_a_stop_that_is_not_looked_at_is_taken_all_the_same(virtual: Simulator, drive: Drive) -> None:
    with drive.motor() as motor:
        motor.run(10.0)
        before = virtual.now()
        motor.stop(confirm=0)
        assert virtual.now() - before < 0.1
        assert not motor.may_turn
    assert told(virtual) == [FORWARD, STOP]


def test_the_same_awaited(virtual: Simulator) -> None:
    async def work() -> None:
        async with drivebus.aio.Bus(virtual) as bus:
            same = await bus.drive(1)
            async with same.motor() as motor:
                await motor.run(10.0)
                await motor.stop()
                assert not motor.may_turn
                await motor.run(10.0, reverse=True)
                asyncio.current_task().cancel()  # type: ignore[union-attr]
                await bus.sleep(10.0)

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(work())
    assert told(virtual) == [FORWARD, STOP, REVERSE, STOP]
