"""A drive that acts by itself when it hears nothing, kept from it by a task."""

from __future__ import annotations

import asyncio
from collections.abc import Generator
from types import TracebackType
from typing import Any

from drivebus.operations.bus_timeout import BusTimeout
from drivebus.operations.drive_view import DriveView
from drivebus.strict_attributes import known_only

__all__ = ["Watchdog"]


@known_only
class Watchdog(BusTimeout):
    """The drive's own time-out, set when this is awaited or entered, and kept from running out until `close`.

    `Drive.watchdog` makes one. Attributes as in `drivebus.watchdog.Watchdog`.
    """

    def __init__(self, drive: DriveView, timeout: float, action: str) -> None:
        super().__init__(drive, timeout, action)
        self._name = f"drivebus watchdog of unit {drive.address}"
        self._task: asyncio.Task[None] | None = None

    def __await__(self) -> Generator[Any, None, Watchdog]:
        return self._begin().__await__()

    async def _begin(self) -> Watchdog:
        await self.set()
        self._task = asyncio.create_task(self._keep_busy(), name=self._name)
        return self

    async def close(self) -> None:
        """Ends it. A motor that slows down is waited for; then the drive gets back the settings that it had.

        Where the motor goes on turning, or cannot be asked, or this is cancelled, the settings stay: the line falls
        silent, and the drive acts by itself (`armed`). Nothing is raised for that; `error` has the reason. Closing
        again does nothing.
        """
        task, self._task = self._task, None
        if task is None:
            return
        try:
            await self.give_back()
        finally:
            task.cancel()

    async def __aenter__(self) -> Watchdog:
        return await self._begin()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def _keep_busy(self) -> None:
        while True:
            await asyncio.sleep(self.interval)
            if not await self.ask():
                return
