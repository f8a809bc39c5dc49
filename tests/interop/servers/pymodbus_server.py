"""A pymodbus slave, unit 1, whose register *a* holds *a*: 0000H to 03FFH. Says `ready` when the port is open.

Its identification needs two answers.

usage: pymodbus_server.py PORT
"""

import asyncio
import sys

from pymodbus import ModbusDeviceIdentification
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice


def say_ready(connected: bool) -> None:
    """Called by pymodbus when the port is open."""
    if connected:
        print("ready", flush=True)


async def main() -> None:
    """Serves until it is ended."""
    registers = SimData(0, values=list(range(0x400)), datatype=DataType.REGISTERS)
    identity = ModbusDeviceIdentification(info={0: "pymodbus", 1: "PM", 2: "3.x", 4: "a slave of others"})  # type: ignore[no-untyped-call]
    for own in (0x80, 0x90):
        identity[own] = chr(own - 0x40) * 120
    server = ModbusSerialServer(
        SimDevice(1, [registers]),
        port=sys.argv[1],
        baudrate=19200,
        parity="N",
        identity=identity,
        trace_connect=say_ready,
    )
    await server.serve_forever()


asyncio.run(main())
