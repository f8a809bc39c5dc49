"""modbus-tk: `modbus_rtu.RtuMaster` on a `serial.Serial`."""

from __future__ import annotations

from collections.abc import Sequence

import serial
from modbus_tk import defines, modbus_rtu

from . import UNIT, Adapter


class Master(Adapter):
    distribution = "modbus-tk"
    settings = "`RtuMaster` and `set_timeout`; it repeats nothing"

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        del retries
        self._master = modbus_rtu.RtuMaster(serial.Serial(port, baudrate=baudrate, parity="N"))
        self._master.set_timeout(timeout)
        self._master.open()

    def read(self, address: int, count: int) -> Sequence[int]:
        return list(self._master.execute(UNIT, defines.READ_HOLDING_REGISTERS, address, count))

    def write(self, address: int, value: int) -> Sequence[int]:
        return list(self._master.execute(UNIT, defines.WRITE_SINGLE_REGISTER, address, output_value=value))

    def broadcast(self, address: int, value: int) -> None:
        self._master.execute(0, defines.WRITE_SINGLE_REGISTER, address, output_value=value)

    def close(self) -> None:
        self._master.close()
