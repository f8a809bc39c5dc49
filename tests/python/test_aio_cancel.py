"""Cancellation: what waits is never sent, what is on the wire leaves a clean line, and a motor is always stopped."""

from __future__ import annotations

import asyncio
import gc
import random
import sys
from collections import Counter
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Simulator, State

Run = Callable[[Coroutine[Any, Any, Any]], Any]

CONTROL, FORWARD, STOP, COAST = 0x2000, 1, 5, 6
STOP_FRAME = bytes.fromhex("01 06 20 00 00 05 42 09")
# P00.10 to P00.12 and P01.20 of both units: answers of one length, of which only the value tells one from another.
PLACES = [(unit, address) for unit in (1, 2) for address in (0x000A, 0x000B, 0x000C, 0x0114)]
TASKS, ROUNDS = 40, 50
# That a unit answers with as many words as it was asked for is assumed where answers come late
# (docs/developers/architecture.md).
BAD_LINE = {"all": 0.02, "short": 0.0, "long": 0.0}
BAD_UNIT = {"all": 0.02, "late": 0.0, "overtaken": 0.0}


def commands(simulator: Simulator, unit: int = 1) -> list[int]:
    return [value for _, address, value in simulator.drive(unit).writes() if address == CONTROL]


def requests(simulator: Simulator) -> list[bytes]:
    return [data for _, who, data in simulator.line.trace() if who == "master"]


def line(**options: Any) -> Simulator:
    return Simulator({1: "gd350", 2: "gd350"}, transport="process", **options)


@asynccontextmanager
async def obedient(**options: Any) -> AsyncIterator[tuple[Simulator, drivebus.aio.Drive]]:
    """A line, and a drive on it that obeys the bus."""
    with line(**options) as simulator:
        async with drivebus.aio.Bus(simulator) as bus:
            drive = await bus.drive(1)
            await drive.prepare_control()
            yield simulator, drive


async def until(true: Callable[[], bool]) -> None:
    while not true():
        await asyncio.sleep(0.001)


class Ahead(asyncio.SelectorEventLoop):
    """Its clock can be put ahead: no time limit ends before a test wants it to."""

    ahead = 0.0

    def time(self) -> float:
        return super().time() + self.ahead


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("faults", [{}, BAD_LINE, BAD_UNIT], ids=["good line", "bad line", "bad unit"])
def test_a_storm_of_cancellations_brings_no_wrong_answer(run: Run, faults: dict[str, float], seed: int) -> None:
    dice = random.Random(seed)
    outcomes: Counter[str] = Counter()

    async def ask(bus: drivebus.aio.Bus, place: int, expected: int) -> None:
        unit, address = PLACES[place]
        verify = dice.random() < 0.2
        try:
            [word] = await bus.read(unit, address, verify=verify)
        except asyncio.CancelledError:
            outcomes["cancelled"] += 1
            raise
        except drivebus.DrivebusError as error:
            outcomes[type(error).__name__] += 1
        else:
            outcomes["right" if word == expected else "wrong"] += 1

    async def storm(bus: drivebus.aio.Bus, expected: list[int]) -> None:
        for _ in range(ROUNDS):
            places = [dice.randrange(len(PLACES)) for _ in range(TASKS)]
            tasks = [asyncio.create_task(ask(bus, place, expected[place])) for place in places]
            for task in dice.sample(tasks, TASKS // 2):
                for _ in range(dice.randrange(4)):
                    await asyncio.sleep(0)
                task.cancel()
            await asyncio.wait(tasks)

    async def main() -> None:
        with line(clock="virtual", seed=seed) as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                for number, (unit, address) in enumerate(PLACES):
                    await bus.write(unit, 0x8000 | address, 100 + number)  # to RAM
                expected = [simulator.drive(unit).register(address) for unit, address in PLACES]
                assert len(set(expected)) == len(PLACES)
                simulator.line.set_faults(**faults)
                await storm(bus, expected)
                simulator.line.set_faults(**dict.fromkeys(faults, 0.0))
                # Afterwards everybody is served.
                await bus.sleep(10.0)
                words = await asyncio.gather(*(bus.read(*place) for place in PLACES))
                assert [word for [word] in words] == expected

    run(main())
    assert outcomes["wrong"] == 0
    assert outcomes["cancelled"] > 0
    # All that nobody cancelled, and those that were quicker than their cancellation.
    ended = sum(outcomes.values()) - outcomes["cancelled"]
    assert ended >= TASKS * ROUNDS / 2
    assert outcomes["right"] >= (0.9 if faults else 1) * ended


def test_what_waits_is_never_sent_and_what_is_on_the_wire_is_not_repeated() -> None:
    async def main() -> None:
        with line() as simulator:
            async with drivebus.aio.Bus(simulator, timeout=2.0, retries=5) as bus:
                await bus.read(1, 0x2103)
                await bus.read(2, 0x2103)
                simulator.line.drop_answers(1)
                sent = simulator.line.requests
                asked = asyncio.create_task(bus.read(1, 0x2100))
                await until(lambda: simulator.line.requests > sent)
                waiting = [asyncio.create_task(bus.write(1, 0x800B, value)) for value in range(20)]
                await asyncio.sleep(0)  # all of them have asked
                for task in [*waiting, asked]:
                    task.cancel()
                done = await asyncio.gather(*waiting, asked, return_exceptions=True)
                assert {type(each) for each in done} == {asyncio.CancelledError}
                # Comes after all that was to be asked of the other unit, if anything still was.
                assert await bus.read(2, 0x2103) == [0x01A0]
                assert simulator.line.requests == sent + 2
                assert simulator.drive(1).writes() == []

    asyncio.run(main())


def test_a_stop_overtakes_200_reads_that_wait() -> None:
    async def main() -> None:
        with line(baudrate=115200) as simulator:
            async with drivebus.aio.Bus(simulator, baudrate=115200, timeout=30.0) as bus:
                drive = await bus.drive(1)
                await drive.prepare_control()
                await drive.run(hz=5.0)
                [other] = await bus.read(1, 0x2103)
                simulator.line.delay_answers(2.0)
                sent = simulator.line.requests
                first = asyncio.create_task(bus.read(1, 0x2103))
                await until(lambda: simulator.line.requests > sent)
                reads = [first, *(asyncio.create_task(bus.read(1, 0x2103)) for _ in range(199))]
                await asyncio.sleep(0)  # all of them have asked
                await drive.stop()
                waiting = sum(not read.done() for read in reads)
                assert await asyncio.gather(*reads) == [[other]] * 200
                seen = requests(simulator)
                assert seen.index(STOP_FRAME) == sent + 1, "the next request after the one in flight"
                # Others may be read while this loop is about to ask for the state, as many as it takes time for that.
                assert waiting > 0

    asyncio.run(main())


class TestMotor:
    """In virtual time, but where a request must be caught on the wire."""

    def test_it_is_stopped_where_its_task_is_cancelled(self, run: Run) -> None:
        async def main() -> None:
            async with obedient(clock="virtual") as (simulator, drive):
                inside = asyncio.Event()

                async def work() -> None:
                    async with drive.running(10.0):
                        inside.set()
                        await asyncio.Event().wait()

                task = asyncio.create_task(work())
                await inside.wait()
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                assert commands(simulator) == [FORWARD, STOP]
                assert (await drive.wait_until_stopped()).state is State.STOPPED

        run(main())

    def test_however_often_it_is_cancelled_while_it_stops(self, run: Run) -> None:
        async def main() -> None:
            async with obedient(clock="virtual") as (simulator, drive):
                inside = asyncio.Event()

                async def work() -> None:
                    async with drive.running(10.0):
                        inside.set()
                        # The stop, the retries of the stop, and the coast: all but the last are lost.
                        simulator.line.drop_answers(20)
                        await asyncio.Event().wait()

                task = asyncio.create_task(work())
                await inside.wait()
                while not task.done():
                    task.cancel()
                    await asyncio.sleep(0)
                assert task.cancelled()
                assert commands(simulator)[0] == FORWARD
                assert set(commands(simulator)[1:]) <= {STOP, COAST}
                assert (await drive.wait_until_stopped()).state is State.STOPPED

        run(main())

    @pytest.mark.parametrize("steps", range(0, 40, 3))
    def test_wherever_its_start_is_cancelled(self, steps: int) -> None:
        async def main() -> None:
            async with obedient(clock="virtual") as (simulator, drive):

                async def work() -> None:
                    async with drive.running(10.0):
                        await asyncio.Event().wait()

                task = asyncio.create_task(work())
                for _ in range(steps):
                    await asyncio.sleep(0.0001 if steps % 2 else 0)
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                sent = commands(simulator)
                assert sent in ([], [STOP], [FORWARD, STOP])
                assert not (await drive.state()).running or sent[-1] == STOP

        asyncio.run(main())

    def test_an_error_from_inside_comes_through_and_a_cancellation_meanwhile_is_not_lost(self) -> None:
        async def main() -> None:
            async with obedient(clock="virtual") as (simulator, drive):
                with pytest.raises(ValueError, match="inside"):
                    async with drive.running(10.0):
                        raise ValueError("inside")
                assert commands(simulator) == [FORWARD, STOP]

                async def work() -> None:
                    async with drive.running(10.0):
                        asyncio.get_running_loop().call_soon(task.cancel)
                        raise ValueError("inside")

                task = asyncio.create_task(work())
                with pytest.raises(asyncio.CancelledError) as raised:
                    await task
                # CPython 3.10 raises a cancellation of its own around the one that was raised.
                inner = raised.value.__context__
                while isinstance(inner, asyncio.CancelledError):
                    inner = inner.__context__
                assert isinstance(inner, ValueError)
                assert commands(simulator)[2:] == [FORWARD, STOP]

        asyncio.run(main())

    def test_a_time_limit_around_the_block_stops_it(self) -> None:
        loop = Ahead()

        async def main() -> None:
            async with obedient(clock="virtual") as (simulator, drive):

                async def work() -> None:
                    async with drive.running(10.0):
                        loop.ahead = 3600.0
                        await asyncio.Event().wait()

                with pytest.raises(asyncio.TimeoutError):
                    await asyncio.wait_for(work(), 1800.0)
                assert commands(simulator) == [FORWARD, STOP]

        try:
            loop.run_until_complete(main())
        finally:
            loop.close()

    @pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
    @pytest.mark.parametrize("stopping", [False, True], ids=["inside", "while it stops"])
    def test_it_is_stopped_at_once_where_the_loop_is_gone(
        self, stopping: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Its scopes keep their task for ever, also where its loop is closed.
        monkeypatch.delitem(sys.modules, "anyio", raising=False)
        inside: list[bool] = []

        async def work(simulator: Simulator) -> None:
            bus = await drivebus.aio.Bus(simulator, timeout=1.0)
            drive = await bus.drive(1)
            await drive.prepare_control()
            async with drive.running(10.0):
                inside.append(True)
                if not stopping:
                    await asyncio.Event().wait()
                simulator.line.drop_answers(1)

        with line() as simulator:
            loop = asyncio.new_event_loop()
            task = loop.create_task(work(simulator))
            while not inside or (stopping and commands(simulator) == [FORWARD]):
                loop.run_until_complete(asyncio.sleep(0))
            loop.close()
            del task
            # The next loop lets go of what waits in one that is closed.
            asyncio.run(drivebus.aio.Bus.open("sim://gd350?clock=virtual"))
            gc.collect()
            sent = commands(simulator)
            assert sent[:2] == [FORWARD, STOP]
            # The first one was not confirmed.
            assert set(sent[2:]) == ({STOP} if stopping else set())
            assert simulator.drive(1).state in ("forward", "stopped")

    def test_a_cancelled_watchdog_gives_back_what_the_drive_had(self) -> None:
        async def main() -> None:
            async with obedient(clock="virtual") as (simulator, drive):
                async with drive.watchdog(30.0, "stop", unverified=True) as watchdog:
                    assert (watchdog.armed, simulator.drive(1).register(0x0E04)) == (True, 300)
                assert (watchdog.armed, simulator.drive(1).register(0x0E04)) == (False, 0)

                async def work() -> None:
                    async with drive.watchdog(30.0, unverified=True):
                        inside.set()
                        await asyncio.Event().wait()

                inside = asyncio.Event()
                task = asyncio.create_task(work())
                await inside.wait()
                task.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await task
                assert simulator.drive(1).register(0x0E04) == 0
                assert "watchdog" not in " ".join(task.get_name() for task in asyncio.all_tasks())

        asyncio.run(main())
