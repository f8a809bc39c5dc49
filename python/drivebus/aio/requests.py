"""What a bus may be asked, awaited: checked as `drivebus.line.blocking_requests` checks it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, overload

from drivebus import _native
from drivebus.aio.line import Line
from drivebus.errors import Refused
from drivebus.line.asking import Read, Stamped, Write
from drivebus.line.blocking import BlockingBus
from drivebus.line.blocking_requests import (
    Requests,
    alone_of,
    broadcast_of,
    echo_of,
    read_of,
    seconds_of,
    transact_of,
    write_of,
)
from drivebus.line.device import DeviceIdentification, device_of
from drivebus.line.stats import Link
from drivebus.line.units import Units

__all__ = ["AwaitedRequests"]


class AwaitedRequests:
    """A line of the core for event loops, and what is known of the units on it. Its calls are those of `Requests`."""

    def __init__(self, line: Line, known: Units) -> None:
        self._line = line
        self._known = known

    def now(self) -> float:
        """See `Requests`, as of all else here."""
        return self._line.now()

    @property
    def reconnects(self) -> int:
        """See `Requests`."""
        return self._line.reconnects

    @property
    def closed(self) -> bool:
        """See `Requests`."""
        return self._line.closed

    @property
    def line(self) -> object:
        """See `Requests`."""
        return self._line.native

    @contextmanager
    def undisturbed(self) -> Iterator[AwaitedRequests]:
        """The same line for a block in which nothing is given up: a cancellation is raised when the block has ended."""
        with self._line.undisturbed() as line:
            yield AwaitedRequests(line, self._known)

    def blocking(self) -> BlockingBus:
        """The same line for who has no event loop: it blocks."""
        return BlockingBus(Requests(self._line.native, self._known))

    async def ask_foreign(self, unit: int, pdu: bytes, reply_length: int, timeout: float) -> bytes:
        """Sends *pdu* within *timeout* seconds, once, also to a unit that may still owe another answer."""
        return await self._line.transact(unit, pdu, reply_length, timeout=timeout, in_doubt=True)

    async def sleep(self, seconds: float, /) -> None:
        """See `Requests`."""
        return await self._line.sleep(seconds_of(seconds))

    async def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """See `Requests`."""
        return await self._line.listen(seconds_of(seconds))

    @overload
    async def ask(self, request: Read, /) -> list[int]: ...
    @overload
    async def ask(self, request: Write, /) -> None: ...
    async def ask(self, request: Read | Write, /) -> list[int] | None:
        """As `Requests.read` and `Requests.write`."""
        how: dict[str, Any] = {"urgent": request.urgent, "table": request.table}
        if isinstance(request, Read):
            how |= {"verify": request.verify, **alone_of(request.timeout, request.retries)}
            return await self._line.read(*self._checked(request), **how)
        how |= {"read_back": request.read_back, "connection": request.connection, "halts": request.halts}
        of = (request.unit, request.address, request.value, request.table, request.urgent)
        checked = write_of(self._known, *of, request.read_back, request.connection, request.halts, request.force)
        await self._line.write(*checked, **how, **alone_of(request.timeout))
        return None

    async def ask_stamped(self, request: Read, /) -> Stamped:
        """As `Requests.read_stamped`."""
        how: dict[str, Any] = {"urgent": request.urgent, "verify": request.verify, "table": request.table}
        return Stamped(*await self._line.read_stamped(*self._checked(request), **how))

    def _checked(self, read: Read) -> tuple[int, int, int]:
        return read_of(self._known, read.unit, read.address, read.count, read.table, read.urgent, read.verify)

    async def link(self, unit: int) -> Link:
        """See `Requests`."""
        return Link(*await self._line.link(self._known.addresses.unit(unit)))

    async def halts(self, unit: int) -> int:
        """See `Requests`."""
        return await self._line.halts(self._known.addresses.unit(unit))

    async def broadcast(self, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
        """See `Requests`."""
        await self._line.broadcast(*broadcast_of(self._known, address, value, force))

    async def echo(self, unit: int, word: int | None = None) -> float:
        """See `Requests`."""
        return await self._line.echo(*echo_of(self._known, unit, word))

    async def device_identification(self, unit: int) -> DeviceIdentification:
        """See `Requests`."""
        unit, question = self._known.addresses.unit(unit), _native.DeviceQuestion()
        while (pdu := question.pdu()) is not None:
            try:
                question.heard(await self._line.transact(unit, pdu, retries=None))
            except Refused as refusal:
                if not question.refused(refusal.code):
                    raise
        return device_of(unit, question)

    async def transact(
        self,
        unit: int,
        pdu: bytes | bytearray | memoryview,
        reply_length: int | None = None,
        *,
        force: bool = False,
    ) -> bytes:
        """See `Requests`."""
        return await self._line.transact(*transact_of(self._known, unit, pdu, reply_length, force))
