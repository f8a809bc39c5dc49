"""uModbus: functions that make a request, and `send_message` on a `serial.Serial`."""

from __future__ import annotations

from collections.abc import Sequence

import serial
from umodbus.client.serial import rtu

from . import UNIT, Adapter


class Master(Adapter):
    distribution = "uModbus"
    settings = "`rtu.send_message` on a `serial.Serial`; it repeats nothing and takes no lock"

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        del retries
        self._port = serial.Serial(port, baudrate=baudrate, parity="N", timeout=timeout)

    def read(self, address: int, count: int) -> Sequence[int]:
        values = rtu.send_message(rtu.read_holding_registers(UNIT, address, count), self._port)
        return [value & 0xFFFF for value in values]

    def write(self, address: int, value: int) -> Sequence[int]:
        return [rtu.send_message(rtu.write_single_register(UNIT, address, value), self._port)]

    def broadcast(self, address: int, value: int) -> None:
        rtu.send_message(rtu.write_single_register(0, address, value), self._port)

    def close(self) -> None:
        self._port.close()
