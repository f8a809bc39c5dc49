"""Three drives of one line in an event loop: each runs at its own speed, and is stopped whatever happens to the others.

python three_drives.py                 three simulated GD350
python three_drives.py /dev/ttyUSB0    units 1 to 3. THEIR MOTORS TURN.
"""

import asyncio
import sys

import drivebus
import drivebus.aio

SPEEDS = {1: 5.0, 2: 7.5, 3: 10.0}  # Hz


async def job(drive: drivebus.aio.Drive, hz: float) -> float:
    """Runs one motor, and says what current it took at its speed."""
    await drive.prepare_control()
    await drive.write({"P00.11": 2.0, "P00.12": 2.0})  # ramps in seconds; RAM, so a power cut forgets them
    async with drive.running(hz, wait=True):
        await drive.wait_for_speed(timeout=30)
        snapshot = await drive.monitor("output_current")
    return float(snapshot.output_current)


async def main(port: str) -> None:
    """All three at once."""
    async with drivebus.aio.Bus(port) as bus:
        drives = [await bus.drive(unit) for unit in SPEEDS]
        jobs = [job(drive, hz) for drive, hz in zip(drives, SPEEDS.values(), strict=True)]
        for drive, came in zip(drives, await asyncio.gather(*jobs, return_exceptions=True), strict=True):
            print(f"unit {drive.unit}: {came if isinstance(came, BaseException) else f'{came:.1f} A'}")
            print(f"unit {drive.unit}: {await drive.status()}")


asyncio.run(main(sys.argv[1] if len(sys.argv) > 1 else "sim://1=gd350,2=gd350,3=gd350?clock=virtual"))
