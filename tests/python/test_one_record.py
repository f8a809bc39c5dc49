"""One record a unit: two handles of one unit have one memory, and are equal."""

from __future__ import annotations

import asyncio

import drivebus
import drivebus.aio
from drivebus import Bus, Simulator


def bench() -> Simulator:
    return Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual")


def test_what_one_handle_wrote_to_ram_the_other_stores() -> None:
    """P00.11 is 10.0 from the factory; RAM loses it with power (GD350 manual, section 9.4.5)."""
    with bench() as simulator, Bus(simulator) as bus:
        first, second = bus.drive(1, "gd350"), bus.drive(1, "gd350")
        first.write("P00.11", 3.0)
        second.write("P00.11", 3.0, store=True)
        assert simulator.drive(1).eeprom_writes == 1
        simulator.drive(1).power_cycle()
        assert second.read("P00.11") == 3.0


def test_it_is_asked_once_whichever_handle_writes() -> None:
    with bench() as simulator, Bus(simulator) as bus:
        bus.echo(1)  # first contact asks whatever comes first twice
        for _ in range(3):
            bus.drive(1, "gd350").write("P00.11", 3.0)
        asked = [frame for _, who, frame in simulator.line.trace() if who == "master" and frame[1:4] == b"\x03\x21\x03"]
        assert len(asked) == 1


def test_handles_of_one_unit_are_equal_and_of_others_not() -> None:
    with bench() as simulator, Bus(simulator) as bus:
        one, same, more = bus.drive(1, "gd350"), bus.drive(1, "gd350"), bus.drive(1, "gd350", unverified=True)
        assert one == same == more
        assert len({one, same, more}) == 1
        assert one != bus.drive(2, "gd350")
        assert one != bus.drive(1, "ms300")
        assert one != 1
        with Bus("sim://gd350") as other:
            assert one != other.drive(1, "gd350")


def test_so_are_those_of_an_event_loop() -> None:
    async def main() -> None:
        with bench() as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                first, second = await bus.drive(1, "gd350"), await bus.drive(1, "gd350")
                assert first == second
                await first.write("P00.11", 3.0)
                await second.write("P00.11", 3.0, store=True)
                assert simulator.drive(1).eeprom_writes == 1

    asyncio.run(main())
