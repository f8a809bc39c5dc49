"""The plant once a second to all pages that are open: looked at and written down once for all of them."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

from drivebus.web.shown import Shown
from drivebus.web.view import LineTimes, happened, view

__all__ = ["EVERY", "Live"]

EVERY = 1.0
"""Seconds between two pictures."""
_EVENTS = 20
"""So many of the last events are in each."""


class Live:
    """Pictures for those who listen. For one event loop.

    Args:
        shown: The plant.
        pause: Waits for some seconds.
    """

    def __init__(self, shown: Shown, pause: Callable[[float], Any] = asyncio.sleep) -> None:
        self._shown = shown
        self._pause = pause
        self._before: LineTimes | None = None
        self._plain: dict[str, Any] | None = None
        self._looked = -EVERY
        self._looking = asyncio.Lock()
        self._encoded = b""
        self._number = 0
        self._came = asyncio.Condition()
        self._listeners = 0
        self._is_over = False

    async def now(self) -> dict[str, Any]:
        """The plant, no older than until the next picture."""
        async with self._looking:
            if self._plain is None or time.monotonic() - self._looked >= EVERY:
                # A look waits for locks, and nobody else shall wait for those.
                self._plain = await asyncio.to_thread(self._look)
                self._looked = time.monotonic()
        return self._plain

    async def run(self) -> None:
        """Looks once a second, where somebody listens. Until it is cancelled."""
        while True:
            if self._listeners:
                plain = await self.now()
                text = json.dumps(plain, ensure_ascii=False, separators=(",", ":"))
                async with self._came:
                    self._encoded = f"data: {text}\n\n".encode()
                    self._number += 1
                    self._came.notify_all()
            await self._pause(EVERY)

    async def pictures(self, goes_on: Callable[[], bool]) -> AsyncIterator[bytes]:
        """The pictures, each as it comes, as long as that *goes_on*. Who is slow is given the newest."""
        is_fresh = bool(self._encoded) and time.monotonic() - self._looked < EVERY
        had = self._number - 1 if is_fresh else self._number
        self._listeners += 1
        try:
            while True:
                async with self._came:
                    while self._number == had and not self._is_over:
                        await self._came.wait()
                    had, encoded = self._number, self._encoded
                if self._is_over or not goes_on():
                    return
                yield encoded
        finally:
            self._listeners -= 1

    async def end(self) -> None:
        """Nobody is given any more."""
        async with self._came:
            self._is_over = True
            self._came.notify_all()

    def _look(self) -> dict[str, Any]:
        picture = self._shown.look()
        plain = view(self._shown, picture, self._before)
        plain["events"] = happened(self._shown.events(), most=_EVENTS)
        self._before = LineTimes.of(picture)
        return plain
