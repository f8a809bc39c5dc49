"""pymodbus: `ModbusSerialClient`, its synchronous client."""

from __future__ import annotations

from collections.abc import Sequence

from pymodbus.client import ModbusSerialClient
from pymodbus.pdu import ModbusPDU

from . import UNIT, Adapter, ErrorReturned


class Master(Adapter):
    distribution = "pymodbus"
    settings = (
        "`ModbusSerialClient`; by default every request is repeated three times; broadcast with `no_response_expected`"
    )

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        if retries is None:
            self._client = ModbusSerialClient(port, baudrate=baudrate, parity="N", timeout=timeout)
        else:
            self._client = ModbusSerialClient(port, baudrate=baudrate, parity="N", timeout=timeout, retries=retries)
        if not self._client.connect():
            raise ConnectionError(port)

    def read(self, address: int, count: int) -> Sequence[int]:
        return list(checked(self._client.read_holding_registers(address, count=count, device_id=UNIT)).registers)

    def write(self, address: int, value: int) -> Sequence[int]:
        answer = checked(self._client.write_register(address, value, device_id=UNIT))
        return [answer.address, *answer.registers]

    def broadcast(self, address: int, value: int) -> None:
        self._client.write_register(address, value, device_id=0, no_response_expected=True)

    def close(self) -> None:
        close: object = self._client.close
        assert callable(close)
        close()


def checked(answer: ModbusPDU) -> ModbusPDU:
    """*answer*, unless it says it is an error."""
    if answer.isError():
        raise ErrorReturned(type(answer).__name__)
    return answer
