"""A gateway made of pymodbus alone: its TCP server, whose data is whatever its serial client reads from the line.

The server hands each request to the `action` of a `SimDevice`, which its documentation gives for that purpose.

    python -m tests.conformance.gateways.forwarder PORT HOST:PORT BAUDRATE TIMEOUT
"""

from __future__ import annotations

import asyncio
import functools
import sys

from pymodbus.client import AsyncModbusSerialClient
from pymodbus.constants import ExcCodes
from pymodbus.exceptions import ModbusException
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

UNITS = range(1, 5)
READ_HOLDING, READ_INPUT = 3, 4


async def forward(
    client: AsyncModbusSerialClient,
    unit: int,
    function: int,
    start: int,
    address: int,
    count: int,
    registers: list[int],
    values: list[int] | list[bool] | None,
) -> ExcCodes | None:
    """Asks *unit*, and puts what it says into *registers*, from which the server answers."""
    words = [int(value) for value in values or ()]
    try:
        if function == READ_HOLDING:
            answer = await client.read_holding_registers(address, count=count, device_id=unit)
        elif function == READ_INPUT:
            answer = await client.read_input_registers(address, count=count, device_id=unit)
        elif len(words) == 1:
            answer = await client.write_register(address, words[0], device_id=unit)
        else:
            answer = await client.write_registers(address, words, device_id=unit)
    except ModbusException:
        return ExcCodes.GATEWAY_NO_RESPONSE
    if answer.isError():
        return ExcCodes(answer.exception_code)
    if not words:
        registers[address - start : address - start + count] = answer.registers
    return None


async def serve(port: str, address: str, baudrate: int, timeout: float) -> None:
    client = AsyncModbusSerialClient(port, baudrate=baudrate, parity="N", timeout=timeout)
    await client.connect()
    host, _, number = address.rpartition(":")
    everything = [SimData(0, count=0x10000, values=0, datatype=DataType.REGISTERS)]
    devices = [SimDevice(unit, simdata=everything, action=functools.partial(forward, client, unit)) for unit in UNITS]
    await ModbusTcpServer(devices, address=(host, int(number))).serve_forever()


if __name__ == "__main__":
    asyncio.run(serve(sys.argv[1], sys.argv[2], int(sys.argv[3]), float(sys.argv[4])))
