"""A whole job with one drive: steps that both faces carry out, and the frames that went out for it."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from typing import Any

import drivebus.aio
from drivebus import Simulator

__all__ = ["asked", "carry_out_awaited", "written"]


def asked(line: Simulator) -> list[str]:
    """What the master sent, as hex."""
    return [frame.hex(" ").upper() for _, who, frame in line.line.trace() if who == "master"]


def written(line: Simulator) -> list[str]:
    """What the master wrote, without CRCs."""
    return [frame[:-6] for frame in asked(line) if frame[3:5] in ("05", "06", "10")]


def carry_out_awaited(
    line: Simulator, family: str, program: Callable[[Simulator, Any], list[Callable[[], Any]]]
) -> None:
    """Carries out *program* with unit 1, by `drivebus.aio`."""

    async def main() -> None:
        async with drivebus.aio.Bus(line) as bus:
            for step in program(line, await bus.drive(1, family, unverified=True)):
                result = step()
                if inspect.isawaitable(result):
                    await result

    asyncio.run(main())
