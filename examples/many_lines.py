"""Several lines in one event loop: each is read as fast as it answers, and none waits for another.

usage: many_lines.py [PORT ...]
"""

import asyncio
import sys

import drivebus
import drivebus.aio

ROUNDS = 20


async def watch(port: str, units: list[int]) -> None:
    """Reads all drives of one line, round after round."""
    async with drivebus.aio.Bus(port) as bus:
        drives = [await bus.drive(unit) for unit in units]
        for _ in range(ROUNDS):
            snapshots = await asyncio.gather(
                *(drive.monitor("running_frequency", "output_current") for drive in drives), return_exceptions=True
            )
            for drive, snapshot in zip(drives, snapshots, strict=True):
                if isinstance(snapshot, drivebus.DrivebusError):
                    print(f"{port}, unit {drive.unit}: {snapshot}")  # the others go on
        stats = bus.stats()
        print(f"{bus.port}: {stats.answers} answers, {stats.timeouts} time-outs")


async def main(ports: list[str]) -> None:
    """All lines at once."""
    await asyncio.gather(*(watch(port, [1, 2]) for port in ports))


asyncio.run(main(sys.argv[1:] or ["sim://1=gd350,2=gd350"] * 4))
