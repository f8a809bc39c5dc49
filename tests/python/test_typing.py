"""What a type checker makes of the API: mypy reads this file, and pytest runs it.

Each `type: ignore` stands where a checker has to complain: one that it does not need is an error of its own.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from typing_extensions import assert_type

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, NotAllowed, Poll
from drivebus.line.bus_options import BusOptions


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus("sim://1=gd350,2=gd350?clock=virtual") as bus:
        yield bus


def test_a_poll_of_drives_gives_arrays_by_drive(bus: Bus) -> None:
    first, second = bus.drive(1), bus.drive(2)
    with bus.poll({first: None, second: ["output_current"]}) as poll:
        assert_type(poll, "Poll[Drive]")
        arrays = poll.batch(2).to_numpy()
        assert_type(arrays, dict[Drive, npt.NDArray[np.void]])
        assert sorted(drive.unit for drive in arrays) == [1, 2]


def test_a_poll_of_addresses_gives_arrays_by_unit(bus: Bus) -> None:
    with bus.poll({1: [(0x2100, 1)], 2: [(0x2103, 2)]}, interval=1.0) as poll:
        assert_type(poll, "Poll[int]")
        assert sorted(poll.batch(2).to_numpy()) == [1, 2]


def test_a_poll_of_both(bus: Bus) -> None:
    drive = bus.drive(1)
    with bus.poll({drive: "output_current", 2: [(0x2103, 1)]}) as poll:
        assert_type(poll, "Poll[Drive | int]")


def test_what_is_asked_may_be_made_elsewhere(bus: Bus) -> None:
    class Pump(Drive):
        """A drive of somebody's own."""

    pump = Pump(bus, 1, drivebus.Profile.builtin("gd350"))
    names = {pump: ("output_current", "bus_voltage")}
    with bus.poll(names) as poll:
        assert_type(poll, "Poll[Pump]")
        assert [sample.unit for sample in poll.batch(1)] == [1]
    drives = [bus.drive(unit) for unit in (1, 2)]
    with bus.poll(dict.fromkeys(drives, ("bus_voltage",))) as poll_of_all:
        assert_type(poll_of_all, "Poll[Drive]")


def test_a_poll_without_a_parameter_is_one_of_anything(bus: Bus) -> None:
    def units(poll: Poll) -> set[int]:
        assert_type(poll, "Poll[Any]")
        return {sample.unit for sample in poll.take()}

    with bus.poll({1: [(0x2100, 1)]}) as poll:
        poll.batch(1, timeout=1.0)
        assert units(poll) == set()


def test_what_nobody_can_be_asked_is_refused(bus: Bus) -> None:
    drive = bus.drive(1)
    with pytest.raises(NotAllowed):
        bus.poll({"x": 3})  # type: ignore[dict-item, type-var]
    with pytest.raises(NotAllowed):
        bus.poll({drive: 5})  # type: ignore[dict-item]
    with pytest.raises(NotAllowed):
        bus.poll({drive: [3, 4]})  # type: ignore[list-item]
    with pytest.raises(NotAllowed):
        bus.poll([drive])  # type: ignore[call-overload]


def test_a_poll_for_event_loops_takes_the_same() -> None:
    async def main(bus: drivebus.aio.Bus) -> None:
        drive = await bus.drive(1)
        assert_type(bus.poll({drive: None}), "drivebus.aio.Poll[drivebus.aio.Drive]")
        assert_type(bus.poll({1: [(0x2100, 1)]}), "drivebus.aio.Poll[int]")
        bus.poll({"x": 3})  # type: ignore[dict-item, type-var]

    assert main is not None


def test_what_a_bus_is_opened_with_is_checked() -> None:
    async def main() -> None:
        await drivebus.aio.Bus.open("/dev/ttyUSB0", baudrate=9600, parity="N", trace=None)
        await drivebus.aio.Bus.open("/dev/ttyUSB0", baudrate="9600")  # type: ignore[arg-type]
        await drivebus.aio.Bus.open("/dev/ttyUSB0", paritty="N")  # type: ignore[call-arg]

    assert main is not None
    taken = list(inspect.signature(Bus).parameters)
    assert taken == ["port", *BusOptions.__annotations__], "what is handed on, in the order of the class"


def test_a_misspelt_attribute_is_seen_before_the_program_runs(bus: Bus) -> None:
    drive: Any = bus.drive(1)
    with pytest.raises(AttributeError):
        drive.setpont = 5
    checked: Drive = drive
    with pytest.raises(AttributeError):
        checked.setpont = 5  # type: ignore[attr-defined]
