"""Attributes that are set: a name that is misspelt is refused, and the closest is named."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

import drivebus
import drivebus.aio

LINE = "sim://gd350?clock=virtual"


@pytest.fixture
def bus() -> Iterator[drivebus.Bus]:
    with drivebus.Bus(LINE) as bus:
        yield bus


def refuse(thing: object, name: str, meant: str) -> None:
    """*name* is refused, *meant* is named, and nothing was set."""
    kind = type(thing).__name__
    with pytest.raises(AttributeError, match=f'^a {kind} has no attribute "{name}"; did you mean "{meant}"\\?$'):
        setattr(thing, name, 5)
    assert not hasattr(thing, name)


def test_a_misspelt_attribute_is_refused(bus: drivebus.Bus) -> None:
    drive = bus.drive(1)
    refuse(drive, "setpont", "setpoint")
    refuse(drive, "torqe", "torque")
    refuse(drive, "profil", "profile")
    refuse(bus, "time_out", "timeout")
    refuse(bus, "fromat", "format")
    with bus.poll({drive: None}) as poll:
        refuse(poll, "intervall", "interval")
    refuse(drive.watchdog(1.0, unverified=True), "eror", "error")


def test_what_is_like_nothing_is_refused_too(bus: drivebus.Bus) -> None:
    with pytest.raises(AttributeError, match=r'^a Drive has no attribute "qqq"$'):
        setattr(bus.drive(1), "qqq", 5)  # noqa: B010


def test_for_event_loops_as_well() -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(LINE) as bus:
            drive = await bus.drive(1)
            refuse(drive, "setpont", "setpoint")
            refuse(bus, "time_out", "timeout")
            async with bus.poll({drive: None}) as poll:
                refuse(poll, "intervall", "interval")
            refuse(drive.watchdog(1.0, unverified=True), "eror", "error")

    asyncio.run(main())


def test_what_there_is_can_be_set(bus: drivebus.Bus) -> None:
    drive = bus.drive(1)
    drive.setpoint = 10.0
    assert drive.setpoint == 10.0
    # As tests of other people's programs do.
    setattr(drive, "stop", lambda: None)  # noqa: B010
    del drive.stop
    setattr(drive, "_mine", 5)  # noqa: B010
    assert vars(drive)["_mine"] == 5


def test_a_class_of_ones_own_may_set_what_it_likes(bus: drivebus.Bus) -> None:
    class Pump(drivebus.Drive):
        def __init__(self, bus: drivebus.Bus) -> None:
            super().__init__(bus, 1, drivebus.Profile.builtin("gd350"))
            self.litres = 5.0

    pump = Pump(bus)
    pump.litres = 6.0
    assert pump.litres == 6.0
