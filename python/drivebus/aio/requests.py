"""What a bus may be asked, awaited: checked as `drivebus.line.requests` checks it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from drivebus.aio.line import Line
from drivebus.line.blocking import BlockingBus
from drivebus.line.requests import (
    Requests,
    alone_of,
    broadcast_of,
    echo_of,
    read_of,
    seconds_of,
    transact_of,
    write_of,
)
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

    async def look(self, unit: int, address: int, timeout: float, table: str = "holding") -> list[int]:
        """Reads one word, within *timeout* seconds, and not again."""
        return await self._line.read(unit, address, 1, timeout=timeout, retries=0, table=table)

    async def ask(self, unit: int, pdu: bytes, reply_length: int, timeout: float) -> bytes:
        """Sends *pdu* within *timeout* seconds, once, also to a unit that may still owe another answer."""
        return await self._line.transact(unit, pdu, reply_length, timeout=timeout, in_doubt=True)

    async def sleep(self, seconds: float, /) -> None:
        """See `Requests`."""
        return await self._line.sleep(seconds_of(seconds))

    async def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """See `Requests`."""
        return await self._line.listen(seconds_of(seconds))

    async def read(
        self,
        unit: int,
        address: int,
        count: int = 1,
        *,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
        timeout: float | None = None,
        retries: int | None = None,
    ) -> list[int]:
        """See `Requests`."""
        unit, address, count = read_of(self._known, unit, address, count, urgent=urgent, verify=verify, table=table)
        alone = alone_of(timeout, retries)
        return await self._line.read(unit, address, count, urgent=urgent, verify=verify, table=table, **alone)

    async def read_stamped(
        self,
        unit: int,
        address: int,
        count: int = 1,
        *,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
    ) -> tuple[list[int], float, float]:
        """See `Requests`."""
        unit, address, count = read_of(self._known, unit, address, count, urgent=urgent, verify=verify, table=table)
        return await self._line.read_stamped(unit, address, count, urgent=urgent, verify=verify, table=table)

    async def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        force: bool = False,
        table: str = "holding",
        timeout: float | None = None,
    ) -> None:
        """See `Requests`."""
        checked = write_of(self._known, unit, address, value, urgent, read_back, connection, force, table)
        await self._line.write(
            *checked,
            urgent=urgent,
            read_back=read_back,
            connection=connection,
            table=table,
            **alone_of(timeout),
        )

    async def link(self, unit: int) -> Link:
        """See `Requests`."""
        return Link(*await self._line.link(self._known.addresses.unit(unit)))

    async def broadcast(self, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
        """See `Requests`."""
        await self._line.broadcast(*broadcast_of(self._known, address, value, force))

    async def echo(self, unit: int, word: int | None = None) -> float:
        """See `Requests`."""
        return await self._line.echo(*echo_of(self._known, unit, word))

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
