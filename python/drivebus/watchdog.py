"""A drive that acts by itself when it hears nothing, kept from it by a thread.

What helps when the program is killed or the cable is cut: the drive has a communication time-out and an action of its
own (`operations.bus_timeout`). The line is kept busy, and when that ends for whatever reason, the drive does what it
was told.
"""

from __future__ import annotations

import atexit
import threading
from types import TracebackType

from drivebus.line.blocking import at_once
from drivebus.operations.bus_timeout import BusTimeout
from drivebus.operations.drive_view import DriveView
from drivebus.strict_attributes import known_only

__all__ = ["Watchdog"]


@known_only
class Watchdog(BusTimeout):
    """The drive's own time-out, set and kept from running out until `close`.

    `Drive.watchdog` makes one. Its parameters are in force when it has been made. Attributes as in `BusTimeout`.
    """

    def __init__(self, drive: DriveView, timeout: float, action: str) -> None:
        super().__init__(drive, timeout, action)
        at_once(self.set())
        self._closed = False
        self._over = threading.Event()
        self._thread = threading.Thread(
            target=self._keep_busy, name=f"drivebus watchdog of unit {drive.address}", daemon=True
        )
        self._thread.start()
        atexit.register(self._rest)

    def close(self) -> None:
        """Ends it. A motor that slows down is waited for; then the drive gets back the settings that it had.

        Where the motor goes on turning, or cannot be asked, the settings stay: the line falls silent, and the drive
        acts by itself (`armed`). Nothing is raised for that; `error` has the reason. Closing again does nothing.
        """
        if self._closed:
            return
        self._closed = True
        try:
            at_once(self.give_back())
        finally:
            self._rest()
            atexit.unregister(self._rest)

    def __enter__(self) -> Watchdog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _keep_busy(self) -> None:
        while not self._over.wait(self.interval):
            if not at_once(self.ask()):
                return

    def _rest(self) -> None:
        """Lets the line fall silent. Also at the end of the program, where no thread may be left inside the core."""
        self._over.set()
        self._thread.join()
