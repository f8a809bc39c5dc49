"""A pymodbus Modbus TCP server, unit 1, whose register *a* holds *a*: 0000H to 03FFH. It closes behind each answer.

Says `ready` when it listens.

usage: pymodbus_tcp_server.py PORT
"""

import asyncio
import sys

from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


async def main() -> None:
    """Serves until it is ended."""
    registers = SimData(0, values=list(range(0x400)), datatype=DataType.REGISTERS)

    def close_behind(sending: bool, data: bytes) -> bytes:
        """Called by pymodbus with what it hears, and with what it sends before it does."""
        if sending:
            for connection in list(server.active_connections.values()):
                asyncio.get_running_loop().call_soon(connection.close)
        return data

    address = ("127.0.0.1", int(sys.argv[1]))
    server = ModbusTcpServer(SimDevice(1, [registers]), address=address, trace_packet=close_behind)
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
