"""A stop that is told while a start is under way wins, however the two interleave: the motor rests afterwards."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import BadArgument, Bus, NotReady, Profile, Simulator, Unconfirmed

from .conftest import NO_PTY

CONTROL, FORWARD, HALTS = 0x2000, 1, {5, 6, 8}
# What is asked before it: the highest frequency, and the state; and the command, with its setpoint.
REQUESTS = {"run": 3, "run_reverse": 3, "jog": 2}

Start = Callable[[drivebus.aio.Drive], Awaitable[None]]
STARTS: dict[str, Start] = {
    "run": lambda drive: drive.run(10.0),
    "run_reverse": lambda drive: drive.run(10.0, reverse=True),
    "jog": lambda drive: drive.jog(),
}


def commands(simulator: Simulator) -> list[int]:
    return [value for _, address, value in simulator.drive(1).writes() if address == CONTROL]


@pytest.mark.parametrize("first", ["stop", "request"])
@pytest.mark.parametrize(("start", "number"), [(start, at) for start, count in REQUESTS.items() for at in range(count)])
def test_the_motor_rests_wherever_a_stop_meets_a_start(
    monkeypatch: pytest.MonkeyPatch, start: str, number: int, first: str
) -> None:
    """At each request of the start a stop is told: before it is left with the line, and while it waits there."""

    async def main() -> None:
        with Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1)
                await drive.prepare_control()
                asked = 0
                stops: list[asyncio.Task[None]] = []

                def meeting(plain: Any) -> Any:
                    async def ask(self: drivebus.aio.Bus, request: Any) -> Any:
                        nonlocal asked
                        if asyncio.current_task() is not starting:
                            return await plain(self, request)
                        asked += 1
                        if asked != number + 1:
                            return await plain(self, request)
                        # Whoever uses the line now keeps both waiting.
                        other = asyncio.create_task(bus.read(2, 0x2103))
                        await asyncio.sleep(0)
                        waits = asyncio.create_task(plain(self, request)) if first == "request" else None
                        await asyncio.sleep(0)
                        stops.append(asyncio.create_task(drive.stop()))
                        for _ in range(5):
                            await asyncio.sleep(0)
                        try:
                            return await (plain(self, request) if waits is None else waits)
                        finally:
                            await asyncio.wait([other, *stops])

                    return ask

                async def started() -> None:
                    await STARTS[start](drive)

                starting = asyncio.create_task(started())
                for name in ("ask", "ask_stamped"):
                    monkeypatch.setattr(drivebus.aio.Bus, name, meeting(getattr(drivebus.aio.Bus, name)))
                [outcome] = await asyncio.gather(starting, return_exceptions=True)
                assert asked > number
                assert await asyncio.gather(*stops) == [None]
                sent = commands(simulator)
                assert sent[-1] in HALTS
                assert not (await drive.wait_until_stopped()).state.running
                if len(sent) == 1:
                    assert isinstance(outcome, NotReady)
                    assert outcome.why == "halted"
                    assert outcome.started is None
                    assert "told to stop" in str(outcome)
                else:
                    assert outcome is None or isinstance(outcome, Unconfirmed)

    asyncio.run(main())


def test_a_start_that_waited_behind_a_stop_is_not_sent(virtual: Simulator, virtual_bus: Bus) -> None:
    """The stop was told, taken and proved, all between two requests of the start."""
    drive = virtual_bus.drive(1)
    drive.prepare_control()
    halts = virtual_bus.halts(1)
    drive.stop()
    assert virtual_bus.halts(1) != halts
    virtual.drive(1).take_writes()
    with pytest.raises(NotReady, match="told to stop") as told:
        virtual_bus.write(1, CONTROL, FORWARD, halts=halts)
    assert (told.value.why, told.value.started, virtual.drive(1).writes()) == ("halted", None, [])
    # What halts goes out in any case, and what was decided on since.
    virtual_bus.write(1, CONTROL, 5, urgent=True, halts=halts)
    drive.run(5.0)
    assert [value for _, place, value in virtual.drive(1).writes() if place == CONTROL] == [5, FORWARD]
    drive.stop()


def test_a_stop_of_one_unit_takes_no_start_of_another_back(virtual_bus: Bus) -> None:
    one, other = virtual_bus.halts(1), virtual_bus.halts(2)
    virtual_bus.write(1, CONTROL, 5, urgent=True)
    virtual_bus.read(1, 0x2100, urgent=True)
    virtual_bus.write(1, 0x000B, 50)
    assert (virtual_bus.halts(1), virtual_bus.halts(2)) == (one + 1, other)
    for wrong in (-1, 2**64, "1", True):
        with pytest.raises(BadArgument, match="halts"):
            virtual_bus.write(1, CONTROL, FORWARD, halts=wrong)  # type: ignore[arg-type]
    with pytest.raises(BadArgument, match="unit"):
        virtual_bus.halts(0)


@NO_PTY
@pytest.mark.usefixtures("folder")
def test_a_stop_by_one_program_takes_back_the_start_of_another() -> None:
    """Two programs that share a port count together, whichever of them has it."""
    with (
        Simulator({1: "gd350"}, transport="pty") as simulator,
        Bus(simulator.port) as owner,
        Bus(simulator.port) as guest,
    ):
        for starter, stopper in ((owner, guest), (guest, owner)):
            halts = starter.halts(1)
            assert stopper.halts(1) == halts
            stopper.write(1, CONTROL, 5, urgent=True)
            assert starter.halts(1) == stopper.halts(1) != halts
            simulator.drive(1).take_writes()
            with pytest.raises(NotReady, match="told to stop"):
                starter.write(1, CONTROL, FORWARD, halts=halts)
            assert simulator.drive(1).writes() == []


@pytest.mark.usefixtures("folder")
def test_a_port_that_changed_hands_knows_of_no_stop_and_starts_nothing(request: pytest.FixtureRequest) -> None:
    """Nobody can say whether the program that is gone was told to stop."""
    with Simulator({1: "gd350"}, transport="pty") as simulator:
        owner, guest = Bus(simulator.port), Bus(simulator.port)
        request.addfinalizer(guest.close)
        halts = guest.halts(1)
        owner.close()
        with pytest.raises(NotReady, match="changed hands"):
            guest.write(1, CONTROL, FORWARD, halts=halts)
        assert simulator.drive(1).writes() == []


class Own:
    """A bus of somebody's own, which hands on what it is asked and counts nothing."""

    def __init__(self, bus: drivebus.aio.Bus) -> None:
        self._bus = bus

    def __getattr__(self, name: str) -> Any:
        if name == "halts":
            raise AttributeError(name)
        return getattr(self._bus, name)


def test_a_bus_that_counts_no_stops_starts_all_the_same() -> None:
    async def main() -> None:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                await (await bus.drive(1)).prepare_control()
                own: Any = Own(bus)
                drive = drivebus.aio.Drive(own, 1, Profile.builtin("gd350"))
                async with drive.running(5.0):
                    assert commands(simulator)[-1] == FORWARD
                assert commands(simulator)[-1] in HALTS

    asyncio.run(main())
