"""How many may wait for a line: who comes when it is full is told so at once, and a stop is let in all the same."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import drivebus.aio
from drivebus import Bus, NoAnswer, NotAllowed, QueueFull, Simulator

SILENT = 9
"""A unit that is not there: asked for, it has the line for a whole time-out."""


@pytest.mark.parametrize(
    ("queue", "message"), [(0, "queue 0 "), (-1, "queue -1 "), (1.5, "queue 1.5 "), ("9", 'queue "9" ')]
)
def test_a_bound_that_is_none_is_refused_before_anything_opens(queue: Any, message: str) -> None:
    for port in ("/dev/drivebus-is-not-here", "socket://127.0.0.1:1"):
        with pytest.raises(NotAllowed, match=message):
            Bus(port, queue=queue)
        with pytest.raises(NotAllowed, match=message):
            asyncio.run(drivebus.aio.Bus.open(port, queue=queue))


def test_who_finds_no_room_is_told_so_and_a_stop_always_finds_some() -> None:
    async def ask(simulator: Simulator) -> list[Any]:
        async with drivebus.aio.Bus(simulator, timeout=0.5, retries=0, queue=2) as bus:
            # The first has the line or has been called to it: of the rest, two wait.
            calls = [bus.read(SILENT, 0x2100), *(bus.read(1, 0x2103) for _ in range(3))]
            stop = bus.write(1, 0x2000, 5, urgent=True)
            return await asyncio.gather(*calls, bus.write(1, 0x000B, 20), stop, return_exceptions=True)

    with Simulator({1: "gd350"}, transport="process") as simulator:
        silent, *reads, last, write, stop = asyncio.run(ask(simulator))
        assert isinstance(silent, NoAnswer)
        assert stop is None
        assert reads == [[0x01A0]] * 2
        for refused in (last, write):
            assert isinstance(refused, QueueFull)
            assert "2 requests wait" in str(refused)
            assert "nothing was sent" in str(refused)
            assert refused.started is None
        assert [(address, value) for _, address, value in simulator.drive(1).writes()] == [(0x2000, 5)]


def test_thousands_of_reads_find_room(virtual: Simulator) -> None:
    async def ask() -> list[list[int]]:
        async with drivebus.aio.Bus(virtual) as bus:
            return await asyncio.gather(*(bus.read(1, 0x2103) for _ in range(3_000)))

    assert asyncio.run(ask()) == [[0x01A0]] * 3_000
