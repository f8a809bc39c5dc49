"""Many lines in one event loop: how late the loop is for everything else while it serves them.

The lines are those of `many_lines`, in a process of their own. Beside the buses a task sleeps a millisecond again and
again; how much later than asked it wakes up is what any other task of the program would feel: a tick of the loop. The
same is measured with the loop idle, which is the machine's own share.

usage: python -m benches.python.aio_loop [--lines 32] [--tcp 4] [--units 8] [--seconds 5] [--json]
"""

from __future__ import annotations

import argparse
import asyncio
import importlib.util
import statistics
import time
from collections.abc import Callable, Coroutine, Sequence
from contextlib import AsyncExitStack
from typing import Any, NamedTuple

from benches.python import many_lines
from benches.python.figures import markdown, show

import drivebus
import drivebus.aio

TICK = 0.001
WORDS = 1


class Figures(NamedTuple):
    """One measurement; times in milliseconds."""

    loop: str
    lines: int
    units: int
    tick_median: float
    tick_p99: float
    tick_most: float
    ticks: int
    reads: float
    """A second, on all buses."""
    shares: list[float]
    """Of the shortest possible cycle, in percent, a bus each, least first."""
    cores: float
    """Processor time of the measured process, all threads, in a second."""
    violations: int
    """Requests that came before the silence was over."""


async def late(until: float) -> list[float]:
    """Milliseconds that a sleep took longer than asked, again and again."""
    found = []
    while (before := time.perf_counter()) < until:
        await asyncio.sleep(TICK)
        found.append(1e3 * (time.perf_counter() - before - TICK))
    return found


async def read(bus: drivebus.aio.Bus, units: int, until: float) -> float:
    """Reads one unit after the other; how many reads a second."""
    unit, count, begun = 0, 0, time.perf_counter()
    while (now := time.perf_counter()) < until:
        unit = unit % units + 1
        await bus.read(unit, many_lines.MONITOR, WORDS)
        count += 1
    return count / (now - begun)


async def serve(ports: Sequence[str], given: argparse.Namespace) -> tuple[list[float], list[float], float]:
    """Ticks, reads a second of each bus, and cores; without ports, of a loop that has nothing else to do."""
    async with AsyncExitStack() as stack:
        opened = (stack.enter_async_context(drivebus.aio.Bus(port, baudrate=many_lines.BAUDRATE)) for port in ports)
        buses = await asyncio.gather(*opened)
        for unit in range(1, given.units + 1):
            await asyncio.gather(*(bus.write(unit, many_lines.RESPONSE_DELAY, 0) for bus in buses))
        # Until each unit has been heard often enough to be asked without a second look.
        warm = time.perf_counter() + many_lines.WARM
        await asyncio.gather(*(read(bus, given.units, warm) for bus in buses))
        until, used = time.perf_counter() + given.seconds, time.process_time()
        reading = asyncio.gather(*(read(bus, given.units, until) for bus in buses))
        ticks = await late(until)
        return ticks, await reading, (time.process_time() - used) / given.seconds


def measure(name: str, run: Callable[[Coroutine[Any, Any, Any]], Any], given: argparse.Namespace) -> Figures:
    """One measurement in a loop of its own."""
    line = drivebus.SerialFormat(many_lines.BAUDRATE)
    shortest = (8 + 5 + 2 * WORDS) * line.char_time + 2 * line.t35
    violations = 0
    if name == "idle":
        ticks, rates, cores = run(serve([], given))
    else:
        lines = many_lines.Lines(given)
        try:
            ticks, rates, cores = run(serve(lines.ports, given))
            _, violations, _ = lines.counts()
        finally:
            lines.close()
    ticks.sort()
    return Figures(
        loop=name,
        lines=len(rates),
        units=given.units if rates else 0,
        tick_median=statistics.median(ticks),
        tick_p99=ticks[len(ticks) * 99 // 100],
        tick_most=ticks[-1],
        ticks=len(ticks),
        reads=sum(rates),
        shares=sorted(100 * shortest * rate for rate in rates),
        cores=cores,
        violations=violations,
    )


HEAD = ["loop", "buses", "units each", "tick: median, ms", "p99, ms", "most, ms"]
HEAD += ["reads/s", "least share", "median share", "cores", "silence violations"]


def row(figures: Figures) -> list[str]:
    """For a table."""
    shares = (
        [f"{figures.shares[0]:.2f} %", f"{statistics.median(figures.shares):.2f} %"] if figures.shares else ["", ""]
    )
    return [
        figures.loop,
        str(figures.lines),
        str(figures.units),
        f"{figures.tick_median:.2f}",
        f"{figures.tick_p99:.2f}",
        f"{figures.tick_most:.2f}",
        f"{figures.reads:.0f}",
        *shares,
        f"{figures.cores:.2f}",
        str(figures.violations),
    ]


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--lines", type=int, default=32)
    options.add_argument("--tcp", type=int, default=4, help="of the lines, behind TCP")
    options.add_argument("--units", type=int, default=8, help="on each line")
    options.add_argument("--seconds", type=float, default=5.0)
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    loops: dict[str, Callable[[Coroutine[Any, Any, Any]], Any]] = {"idle": asyncio.run, "asyncio": asyncio.run}
    if importlib.util.find_spec("uvloop") is not None:
        import uvloop

        loops["uvloop"] = uvloop.run
    runs = [measure(name, run, given) for name, run in loops.items()]
    show(given.json, [each._asdict() for each in runs], markdown(HEAD, [row(each) for each in runs]))


if __name__ == "__main__":
    main()
