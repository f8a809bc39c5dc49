"""drivebus: `Bus`."""

from __future__ import annotations

from collections.abc import Sequence

import drivebus

from . import UNIT, Adapter


class Master(Adapter):
    distribution = "drivebus"
    settings = "`Bus(port)`; by default a read is repeated twice after silence, four times after damage; a write is not"

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        if retries is None:
            self._bus = drivebus.Bus(port, baudrate=baudrate, parity="N", timeout=timeout)
        else:
            self._bus = drivebus.Bus(port, baudrate=baudrate, parity="N", timeout=timeout, retries=retries)

    def read(self, address: int, count: int) -> Sequence[int]:
        return self._bus.read(UNIT, address, count)

    def write(self, address: int, value: int) -> None:
        self._bus.write(UNIT, address, value)

    def broadcast(self, address: int, value: int) -> None:
        self._bus.broadcast(address, value)

    def close(self) -> None:
        self._bus.close()
