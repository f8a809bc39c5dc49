"""Event loops: many buses in one, none of them polled, and whatever ends first ends cleanly."""

from __future__ import annotations

import asyncio
import gc
import os
import selectors
import subprocess
import sys
import threading
from collections.abc import Callable, Coroutine
from contextlib import AsyncExitStack
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Simulator

Run = Callable[[Coroutine[Any, Any, Any]], Any]

BUSES, UNITS = 32, 8


def line(**options: Any) -> Simulator:
    return Simulator({1: "gd350", 2: "gd350"}, transport="process", **options)


def test_32_buses_with_8_units_each_in_one_loop(run: Run) -> None:
    units = ",".join(f"{unit}=gd350" for unit in range(1, UNITS + 1))

    async def one(bus: drivebus.aio.Bus, number: int) -> None:
        async def unit(address: int) -> None:
            await bus.write(address, 0x800B, 100 * number + address)
            for _ in range(10):
                assert await bus.read(address, 0x000B) == [100 * number + address]

        await asyncio.gather(*(unit(address) for address in range(1, UNITS + 1)))

    async def main() -> None:
        async with AsyncExitStack() as stack:
            opened = (stack.enter_async_context(drivebus.aio.Bus(f"sim://{units}?clock=virtual")) for _ in range(BUSES))
            buses = await asyncio.gather(*opened)
            await asyncio.gather(*(one(bus, number) for number, bus in enumerate(buses)))
            assert [bus.stats()["answers"] >= UNITS * 11 for bus in buses] == [True] * BUSES

    run(main())


class Counting(selectors.DefaultSelector):
    """Counts how often the loop looks for something to do."""

    looks = 0

    def select(self, timeout: float | None = None) -> Any:
        self.looks += 1
        return super().select(timeout)


def test_the_loop_sleeps_while_a_request_is_under_way() -> None:
    selector = Counting()

    async def main() -> None:
        with line() as simulator:
            async with drivebus.aio.Bus(simulator, timeout=30.0) as bus:
                await bus.read(1, 0x2100)
                simulator.line.delay_answers(0.5)
                before = selector.looks
                assert await bus.read(1, 0x2100) == [3]
                # One in which the answer came, one before it, and one in which the task went on.
                assert selector.looks - before <= 3

    loop = asyncio.SelectorEventLoop(selector)
    try:
        loop.run_until_complete(main())
    finally:
        loop.close()


def test_under_anyio() -> None:
    anyio = pytest.importorskip("anyio")

    async def main() -> None:
        with line(clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1)
                await drive.prepare_control()
                words: list[int] = []

                async def ask() -> None:
                    words.extend(await bus.read(2, 0x2103))

                async with anyio.create_task_group() as group:
                    for _ in range(5):
                        group.start_soon(ask)
                assert words == [0x01A0] * 5
                with anyio.CancelScope() as scope:
                    async with drive.running(10.0):
                        scope.cancel()
                        await anyio.sleep_forever()
                assert scope.cancelled_caught
                assert not (await drive.state()).running or (await drive.wait_until_stopped()).frequency == 0
                assert [value for _, address, value in simulator.drive(1).writes() if address == 0x2000] == [1, 5]

    anyio.run(main, backend="asyncio")


def test_more_dead_units_than_threads_keep_nobody_from_the_line(run: Run) -> None:
    async def main() -> None:
        with line(clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator, timeout=0.1) as bus:
                dead = [asyncio.create_task(bus.read(unit, 0x2100)) for unit in range(10, 110) for _ in range(2)]
                await asyncio.sleep(0)
                for _ in range(20):
                    assert await bus.read(1, 0x2100, urgent=True) == [3]
                    assert await bus.read(2, 0x2100) == [3]
                ends = await asyncio.gather(*dead, return_exceptions=True)
                assert {type(end) for end in ends} == {drivebus.NoAnswer}

    run(main())


def test_one_bus_in_several_loops_at_once() -> None:
    with line(clock="virtual") as simulator:

        async def opened() -> drivebus.aio.Bus:
            return await drivebus.aio.Bus.open(simulator)

        bus = asyncio.run(opened())
        right: list[bool] = []

        async def read(unit: int) -> None:
            words = await asyncio.gather(*(bus.read(unit, 0x2103) for _ in range(100)))
            right.append(words == [[0x01A0]] * 100)

        threads = [threading.Thread(target=asyncio.run, args=(read(1 + number % 2),)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert right == [True] * 4
        asyncio.run(bus.close())
        assert bus.closed


def test_closing_ends_what_waits(run: Run) -> None:
    async def main() -> None:
        with line() as simulator:
            bus = await drivebus.aio.Bus(simulator, timeout=30.0)
            simulator.line.drop_answers(1000)
            tasks = [asyncio.create_task(bus.read(1, 0x2100)) for _ in range(10)]
            await asyncio.sleep(0)
            await bus.close()
            for task in tasks:
                with pytest.raises(drivebus.PortError, match="the bus is closed"):
                    await task
            with pytest.raises(drivebus.PortError, match="the bus is closed"):
                await bus.read(1, 0x2100)
            await bus.close()

    run(main())


def test_a_bus_that_is_not_open_says_so() -> None:
    async def main() -> None:
        bus = drivebus.aio.Bus("sim://gd350?clock=virtual")
        assert "not open" in repr(bus)
        with pytest.raises(drivebus.PortError, match="is not open yet"):
            await bus.read(1, 0x2100)
        with pytest.raises(drivebus.PortError, match="is not open yet"):
            bus.stats()
        await bus.close()
        async with bus:
            assert bus.stats().requests == 0
            assert await bus.read(1, 0x2100) == [3]
            native = bus._native
            assert await bus is bus
            assert bus._native is native, "it is opened once"
        with pytest.raises(drivebus.PortError):
            await drivebus.aio.Bus.open("/dev/drivebus-no-such-port")
        with pytest.raises(drivebus.NotAllowed):
            await drivebus.aio.Bus.open("sim://gd350", timeout=-1)

    asyncio.run(main())


def test_a_loop_that_dies_with_requests_open_leaves_the_bus_usable(run: Run) -> None:
    with line() as simulator:

        async def leave() -> drivebus.aio.Bus:
            bus = await drivebus.aio.Bus(simulator, timeout=0.2)
            simulator.line.drop_answers(1)
            for _ in range(5):
                asyncio.get_running_loop().create_task(bus.read(1, 0x2100))
            await asyncio.sleep(0)
            return bus

        bus = run(leave())
        gc.collect()

        async def read() -> None:
            await bus.sleep(0.5)
            assert await bus.read(1, 0x2100) == [3]
            await bus.close()

        asyncio.run(read())


DYING = {
    "left": "asyncio.run(main())",
    "destroyed": """
loop = asyncio.new_event_loop()
task = loop.create_task(main())
while not begun:
    loop.run_until_complete(asyncio.sleep(0.01))
loop.close()
""",
    "in a daemon thread": """
threading.Thread(target=lambda: asyncio.run(forever()), daemon=True).start()
while not begun:
    pass
""",
}


@pytest.mark.parametrize("how", DYING)
def test_a_program_ends_whatever_is_open(how: str) -> None:
    program = f"""
import asyncio, threading, drivebus.aio
begun = []
async def main():
    bus = await drivebus.aio.Bus("sim://gd350", timeout=60)
    bus.simulator.line.drop_answers(1000)
    tasks = [asyncio.create_task(bus.read(1, 0x2100)) for _ in range(20)]
    await asyncio.sleep(0.05)
    begun.append(bus)
    return tasks
async def forever():
    tasks = await main()
    await asyncio.wait(tasks)
{DYING[how]}
print("end", flush=True)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=False)
    assert (done.stdout, done.returncode) == ("end\n", 0), done.stderr


@pytest.mark.skipif(os.name == "nt", reason="no fork")
def test_a_forked_child_is_told_that_the_line_is_its_parents() -> None:
    program = """
import asyncio, os, sys, drivebus.aio
async def child(bus):
    try:
        await bus.read(1, 0x2100)
    except drivebus.PortError as error:
        return 7 if "forked" in str(error) else 1
async def main():
    async with drivebus.aio.Bus("sim://gd350") as bus:
        await bus.read(1, 0x2100)
        pid = os.fork()
        if not pid:
            os._exit(await_child(bus))
        status = os.waitpid(pid, 0)[1] >> 8
        print(status, await bus.read(1, 0x2100))
def await_child(bus):
    asyncio._set_running_loop(None)
    return asyncio.new_event_loop().run_until_complete(child(bus))
asyncio.run(main())
"""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True, timeout=100, check=False
    )
    assert (done.stdout, done.returncode) == ("7 [3]\n", 0), done.stderr
