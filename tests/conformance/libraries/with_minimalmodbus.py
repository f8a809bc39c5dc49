"""minimalmodbus: `Instrument`."""

from __future__ import annotations

from collections.abc import Sequence

import minimalmodbus

from . import UNIT, Adapter


class Master(Adapter):
    distribution = "minimalmodbus"
    settings = "`Instrument`; it repeats nothing; broadcast through a second `Instrument` of address 0 on the same port"

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        del retries
        self._instrument = minimalmodbus.Instrument(port, UNIT)
        self._instrument.serial.baudrate = baudrate
        self._instrument.serial.timeout = timeout

    def read(self, address: int, count: int) -> Sequence[int]:
        return list(self._instrument.read_registers(address, count))

    def write(self, address: int, value: int) -> None:
        self._instrument.write_register(address, value, functioncode=6)

    def broadcast(self, address: int, value: int) -> None:
        everybody = minimalmodbus.Instrument(self._instrument.serial, 0)
        everybody.write_register(address, value, functioncode=6)

    def close(self) -> None:
        self._instrument.serial.close()
