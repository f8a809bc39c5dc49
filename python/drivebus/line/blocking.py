"""Operations that are written to be awaited, carried out at once: for a line whose calls block by themselves.

Each operation stands once, as a coroutine. Over a bus that blocks it waits for nothing else, so one step takes it from
its beginning to its end, in the caller's own thread.
"""

from __future__ import annotations

from collections.abc import Coroutine
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any, TypeVar, overload

from drivebus.line.asking import Read, Stamped, Write
from drivebus.line.blocking_requests import Requests
from drivebus.line.protocols import BusProtocol, CountsHalts

if TYPE_CHECKING:
    from drivebus.line.stats import Link

__all__ = ["BlockingBus", "at_once"]

_R = TypeVar("_R")


class BlockingBus:
    """A bus that blocks, for operations that await: whatever they await is there when they ask."""

    def __init__(self, bus: BusProtocol) -> None:
        self._bus = bus

    @property
    def reconnects(self) -> int:
        """See `BusProtocol`, as of all else here."""
        return self._bus.reconnects

    @property
    def closed(self) -> bool:
        """See `BusProtocol`."""
        return self._bus.closed

    def now(self) -> float:
        """See `BusProtocol`."""
        return self._bus.now()

    async def sleep(self, seconds: float, /) -> None:
        """See `BusProtocol`."""
        self._bus.sleep(seconds)

    @overload
    async def ask(self, request: Read, /) -> list[int]: ...
    @overload
    async def ask(self, request: Write, /) -> None: ...
    async def ask(self, request: Read | Write, /) -> list[int] | None:
        """See `AwaitableBus`."""
        if isinstance(request, Read):
            rest = _of(request.table) | self._alone(timeout=request.timeout, retries=request.retries)
            how = {"urgent": request.urgent, "verify": request.verify, **rest}
            return self._bus.read(request.unit, request.address, request.count, **how)
        rest = _of(request.table) | self._alone(timeout=request.timeout) | ({"force": True} if request.force else {})
        if request.halts is not None:
            rest["halts"] = request.halts
        self._bus.write(
            request.unit,
            request.address,
            request.value,
            urgent=request.urgent,
            read_back=request.read_back,
            connection=request.connection,
            **rest,
        )
        return None

    async def ask_stamped(self, request: Read, /) -> Stamped:
        """See `AwaitableBus`."""
        how = {"urgent": request.urgent, "verify": request.verify, **_of(request.table)}
        return Stamped(*self._bus.read_stamped(request.unit, request.address, request.count, **how))

    def _alone(self, **wanted: float | None) -> dict[str, Any]:
        """What one call wants otherwise; nothing of a bus of somebody's own, which has time-outs of its own."""
        given = {name: value for name, value in wanted.items() if value is not None}
        return given if isinstance(self._bus, Requests) else {}

    async def link(self, unit: int, /) -> Link:
        """See `BusProtocol`."""
        return self._bus.link(unit)

    async def halts(self, unit: int, /) -> int | None:
        """See `AwaitsHalts`."""
        return self._bus.halts(unit) if isinstance(self._bus, CountsHalts) else None

    @property
    def line(self) -> object:
        """See `AwaitableBus`."""
        return getattr(self._bus, "line", self._bus)

    def undisturbed(self) -> AbstractContextManager[BlockingBus]:
        """Itself: no caller can take back what blocks it."""
        return nullcontext(self)

    def blocking(self) -> BlockingBus:
        """Itself."""
        return self


def _of(table: str) -> dict[str, Any]:
    """What a bus is told of *table*: nothing of holding registers, so that a bus which knows no other will do."""
    return {} if table == "holding" else {"table": table}


def at_once(work: Coroutine[Any, Any, _R]) -> _R:
    """Carries *work* out. It must not wait for anything but a `BlockingBus`."""
    try:
        work.send(None)
    except StopIteration as done:
        result: _R = done.value
        return result
    work.close()
    raise RuntimeError(f"{work!r} waits for an event loop, and there is none")
