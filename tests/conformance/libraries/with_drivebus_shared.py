"""drivebus: a `Bus` that uses the port through another one, which opened it first."""

from __future__ import annotations

import drivebus

from . import with_drivebus


class Master(with_drivebus.Master):
    settings = f"{with_drivebus.Master.settings}; through another program"

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        self._host = drivebus.Bus(port, baudrate=baudrate, parity="N")
        super().__init__(port, baudrate, timeout, retries)

    def close(self) -> None:
        super().close()
        self._host.close()
