"""The same buses and drives for asyncio: the same names, awaitable.

    import asyncio
    import drivebus.aio

    async def main():
        async with drivebus.aio.Bus("sim://gd350") as bus:
            drive = await bus.drive(1)
            await drive.prepare_control()
            async with drive.running(hz=10.0):
                await drive.wait_for_speed(timeout=30)
                print(await drive.status(), await drive.monitor("output_current"))

    asyncio.run(main())

Threads of the bus's own wait for the wire, without the GIL; the event loop is woken when there is something for it, and
polls nothing. Works with any event loop of asyncio, uvloop's too, and so under anyio on asyncio.
"""

from drivebus.aio.bus import Bus
from drivebus.aio.drive import Drive
from drivebus.aio.motor import Motor
from drivebus.aio.poll import Poll
from drivebus.aio.watchdog import Watchdog

__all__ = ["Bus", "Drive", "Motor", "Poll", "Watchdog"]


def __dir__() -> list[str]:
    """The public names, as of `drivebus`."""
    return sorted(__all__)
