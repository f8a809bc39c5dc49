"""Cyclic polling awaited: the same samples, one wake-up for each wait, and nothing lost by who is cancelled."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

import drivebus.aio
from drivebus import NotAllowed, Simulator

Run = Callable[[Coroutine[Any, Any, Any]], Any]

STATE = 0x2100
KINDS = [
    pytest.param({"transport": "process", "clock": "virtual"}, id="virtual"),
    pytest.param({"transport": "pty"}, id="pty", marks=pytest.mark.skipif(os.name == "nt", reason="no pty")),
]


def line(**options: Any) -> Simulator:
    return Simulator({1: "gd350", 2: "gd350"}, **options)


@pytest.mark.parametrize("kind", KINDS)
def test_samples_come_in_turn_with_their_values(run: Run, kind: dict[str, Any]) -> None:
    async def main() -> None:
        with line(**kind) as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                first, second = await bus.drive(1), await bus.drive(2)
                async with bus.poll({first: ["status_word_1", "output_current"], second: None}) as poll:
                    samples = []
                    heard = None
                    async for sample in poll:
                        samples.append(sample)
                        # On a busy machine an answer may come after the time-out that is learned.
                        if sample and sample.drive is first:
                            heard = sample
                        if heard is not None and len(samples) >= 4 and sample.drive is second:
                            break
                    assert [sample.drive for sample in samples[:4]] == [first, second] * 2
                    assert dict(heard or {}) == {"status_word_1": 3, "output_current": 0.0}
                    assert [sample.unit for sample in await poll.batch(5)] == [1, 2, 1, 2, 1]
                    assert len(await poll.batch()) >= 1
                assert poll.closed
                assert await bus.read(1, STATE) == [3]

    run(main())


@pytest.mark.parametrize("kind", KINDS)
def test_a_batch_ends_with_its_time_and_the_poll_goes_on(run: Run, kind: dict[str, Any]) -> None:
    async def main() -> None:
        with line(**kind) as simulator:
            async with drivebus.aio.Bus(simulator) as bus, bus.poll({1: [(STATE, 1)]}, interval=3600.0) as poll:
                assert len(await poll.batch(1)) == 1
                assert len(await poll.batch(1, timeout=0.01)) == 0
                assert not await poll.wait(0.01)
                assert not poll.closed

    run(main())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("what", ["poll", "bus"])
def test_closing_ends_who_waits(run: Run, kind: dict[str, Any], what: str) -> None:
    async def main() -> None:
        with line(**kind) as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                poll = bus.poll({1: [(STATE, 1)]}, interval=1e4)
                await poll.batch(1)

                async def rest() -> list[drivebus.Sample]:
                    return [sample async for sample in poll]

                waiting = asyncio.ensure_future(rest())
                await asyncio.sleep(0)
                await (poll if what == "poll" else bus).close()
                await waiting
                assert poll.closed

    run(main())


@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_who_is_cancelled_takes_no_sample_with_it(run: Run) -> None:
    async def main() -> None:
        with line() as simulator:
            async with drivebus.aio.Bus(simulator) as bus, bus.poll({1: [(STATE, 1)]}) as poll:
                times: list[float] = []
                while len(times) < 30:
                    waiting = asyncio.ensure_future(poll.batch(3))
                    await asyncio.sleep(0)
                    waiting.cancel()
                    await asyncio.wait([waiting])
                    times += [sample.time for sample in await poll.batch(5)]
                assert poll.dropped == 0
                taken = len(times) + len(poll.take())
                await poll.close()
                assert taken + len(poll.take()) == poll.cycles

    run(main())


def test_what_is_wrong_is_refused_at_once(run: Run) -> None:
    async def main() -> None:
        with line(transport="process", clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1)
                with pytest.raises(NotAllowed, match="at least"):
                    bus.poll({drive: None}, interval=0.001)
                with drivebus.Bus("sim://gd350?clock=virtual") as other, pytest.raises(NotAllowed, match="another bus"):
                    bus.poll({other.drive(1): None})  # type: ignore[type-var]

    run(main())
