"""tmodbus: `create_async_rtu_client`, on an event loop that runs in a thread of its own.

The loop runs between calls too, as it does in a program built on asyncio. A call from another thread costs a hand-over.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Coroutine, Sequence
from typing import Any

import serialx  # noqa: F401 - tmodbus imports it while it opens a port, and would count that against its time-out
from tmodbus import create_async_rtu_client

from . import UNIT, Adapter


class Master(Adapter):
    distribution = "tmodbus"
    settings = (
        "`create_async_rtu_client` on a running event loop; by default it repeats nothing and reconnects by itself"
    )

    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None:
        del retries
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, name="loop", daemon=True).start()
        self._client = create_async_rtu_client(port, unit_id=UNIT, timeout=timeout, baudrate=baudrate)
        self._run(self._client.connect())

    def _run(self, call: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(call, self._loop).result()

    def read(self, address: int, count: int) -> Sequence[int]:
        return list(self._run(self._client.read_holding_registers(address, count)))

    def write(self, address: int, value: int) -> Sequence[int]:
        return [self._run(self._client.write_single_register(address, value))]

    def broadcast(self, address: int, value: int) -> None:
        self._run(self._client.for_unit_id(0).write_single_register(address, value))

    def close(self) -> None:
        self._run(self._client.disconnect())
        self._loop.call_soon_threadsafe(self._loop.stop)
