"""What was renamed before 0.1 works under its former name, and says the name that it has now."""

from __future__ import annotations

import asyncio
import warnings
from collections.abc import Iterator

import pytest

import drivebus.aio
from drivebus import Bus, Drive, Simulator

PERCENT = (
    "torque",
    "motoring_torque_limit",
    "braking_torque_limit",
    "vf_voltage",
    "analog_output_1",
    "analog_output_2",
)
IN_HZ = ("forward_limit", "reverse_limit")


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(simulator: Simulator) -> Iterator[Drive]:
    with Bus(simulator, timeout=0.25) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        yield drive


@pytest.mark.parametrize("name", [*PERCENT, *IN_HZ])
def test_an_attribute_says_what_to_write_instead(drive: Drive, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf'drive\.{name} = 10.5 is drive\.write_setpoint\(10\.5, "{name}"\)'):
        setattr(drive, name, 10.5)
    with pytest.warns(DeprecationWarning, match=rf'drive\.{name} is drive\.read_setpoint\("{name}"\) now') as said:
        assert getattr(drive, name) == 10.5
    assert said[0].filename == __file__


def test_ask_and_give_are_read_and_write_setpoint(drive: Drive) -> None:
    with pytest.warns(DeprecationWarning, match="give is drive.write_setpoint"):
        drive.give("torque", 12.5)
    with pytest.warns(DeprecationWarning, match="ask is drive.read_setpoint"):
        assert drive.ask("torque") == 12.5


def test_it_says_so_once_for_each_place(drive: Drive) -> None:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        for _ in range(3):
            assert drive.torque == 0.0
    assert len(said) == 1


def test_the_setpoint_of_a_drive_whose_calls_block_stays(drive: Drive) -> None:
    drive.setpoint = 12.5
    assert (drive.setpoint, drive.read_setpoint()) == (12.5, 12.5)


def test_in_asyncio_they_are_awaited_and_say_the_same(simulator: Simulator) -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(1)
            await drive.prepare_control()
            with pytest.warns(DeprecationWarning, match=r'set_torque is drive\.write_setpoint\(…, "torque"\)'):
                await drive.set_torque(10.5)
            with pytest.warns(DeprecationWarning, match=r'torque is drive\.read_setpoint\("torque"\)'):
                assert await drive.torque == 10.5
            with pytest.warns(DeprecationWarning, match=r"set_setpoint is drive\.write_setpoint\(…\)"):
                await drive.set_setpoint(hz=12.5)
            with pytest.warns(DeprecationWarning, match=r"setpoint is drive\.read_setpoint\(\)"):
                assert await drive.setpoint == 12.5
            with pytest.warns(DeprecationWarning, match="give is drive.write_setpoint"):
                await drive.give("torque", 5.0)
            with pytest.warns(DeprecationWarning, match="ask is drive.read_setpoint"):
                assert await drive.ask("torque") == 5.0
            simulator.drive(1).take_writes()
            for name, now in (("setpoint", "write_setpoint(10.0)"), ("torque", 'write_setpoint(10.0, "torque")')):
                with pytest.raises(AttributeError) as refused:
                    setattr(drive, name, 10.0)
                assert str(refused.value) == f"nothing was sent: a drive of asyncio is told by await drive.{now}"
            assert simulator.drive(1).take_writes() == []

    asyncio.run(main())


def test_what_is_not_awaited_is_said(simulator: Simulator) -> None:
    """A value that nobody awaited was true whatever the drive holds."""

    async def main() -> None:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(1)
            asked = bus.stats().requests
            with (
                pytest.warns(RuntimeWarning, match="never awaited"),
                pytest.warns(DeprecationWarning, match="read_setpoint"),
            ):
                assert drive.setpoint  # type: ignore[truthy-bool]
            assert bus.stats().requests == asked

    asyncio.run(main())
