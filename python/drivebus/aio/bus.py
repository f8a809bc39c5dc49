"""A line with units on it, for asyncio. What each call checks and asks is what `drivebus.Bus` checks and asks."""

from __future__ import annotations

import functools
import os
from collections.abc import AsyncIterator, Generator, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from errno import EBADF
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar, overload

from drivebus import _native
from drivebus.aio.drive import Drive
from drivebus.aio.line import Line
from drivebus.aio.poll import Poll
from drivebus.aio.requests import AwaitedRequests
from drivebus.bus import Bus as BlockingFace
from drivebus.checks import UNITS
from drivebus.errors import PortError
from drivebus.identify import scan
from drivebus.identify.identify import identify
from drivebus.identify.profile_choice import profile_of
from drivebus.identify.results import Found, Identification
from drivebus.line.asking import Read, Stamped, Write, asking
from drivebus.line.blocking import BlockingBus
from drivebus.line.blocking_requests import Requests
from drivebus.line.device import DeviceIdentification
from drivebus.line.poll_samples import Names, Reads
from drivebus.line.protocols import AwaitableBus
from drivebus.line.scan_order import asked
from drivebus.line.settings import BusFace, Opening, check_trust
from drivebus.line.stats import Link
from drivebus.line.units import belongs
from drivebus.operations.drive_base import documented_by, views
from drivebus.operations.halting import WITHIN
from drivebus.operations.program_end import end_over
from drivebus.operations.stop_all import stop_all
from drivebus.plain_annotations import plain_annotations
from drivebus.profile import Profile, native_of
from drivebus.strict_attributes import known_only

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from drivebus.line.bus_options import BusOptions

__all__ = ["Bus"]

_AnyDrive = TypeVar("_AnyDrive", bound=Drive)


@plain_annotations
@known_only
class Bus(BusFace):
    """One line, as `drivebus.Bus`, for asyncio.

        async with drivebus.aio.Bus("/dev/ttyUSB0") as bus:
            print(await bus.read(1, 0x2100))

    or `bus = await drivebus.aio.Bus.open("/dev/ttyUSB0")`, and in the end `await bus.close()`. Opening takes as long as
    the system takes, and keeps no event loop from anything. Arguments, attributes and errors are those of
    `drivebus.Bus`.

    Whoever is cancelled while a request waits for the line takes it back: it is not sent. One that is on the wire ends
    by itself, its answer is counted and thrown away, and nothing of it is repeated. So a write or a command that was
    cancelled may have been done: ask the drive.

    May be used from any task of any event loop, one loop after the other or several at once.
    """

    def _begin(self, opening: Opening) -> None:
        self._opening = opening
        self._native: _native.Bus | None = None
        self._line: Line | None = None
        self._requests: AwaitedRequests | None = None

    @classmethod
    async def open(cls, port: object, **keywords: Unpack[BusOptions]) -> Bus:
        """Opens *port*; the keywords are those of the class."""
        return await cls(port, **keywords)

    def __await__(self) -> Generator[Any, None, Bus]:
        return self.__aenter__().__await__()

    async def _open(self) -> Bus:
        opening = self._opening
        try:
            line = await Line.open(opening.target, opening.format, opening.keywords)
        except BaseException:
            opening.close()
            raise
        self._native = line.native
        belongs(opening.known, line.native)
        opening.trace.begin(line.native)
        self._line = line
        self._requests = AwaitedRequests(line, opening.known)
        return self

    def _core(self) -> _native.Bus:
        if self._native is None:
            shown = self._opening.shown
            how = "say `async with Bus(…) as bus:` or `await Bus.open(…)`"
            raise PortError(f"{shown} is not open yet; {how}", errno=EBADF)
        return self._native

    def _asked(self) -> AwaitedRequests:
        self._core()
        assert self._requests is not None
        return self._requests

    async def __aenter__(self) -> Bus:
        return self if self._native is not None else await self._open()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    def __repr__(self) -> str:
        return super().__repr__() if self._native is not None else f"<Bus on {self._opening.shown}, not open yet>"

    async def close(self) -> None:
        """Closes the port, and ends a simulator that this bus made. Closing again does nothing.

        A motor that a block of another task runs over it is stopped before. What still waits for the line ends with
        `PortError`.
        """
        if self._line is None:
            return
        end_over(self.line)
        with self._line.undisturbed() as line:
            await line.close()
            self._opening.close()

    @overload
    async def ask(self, request: Read, /) -> list[int]: ...
    @overload
    async def ask(self, request: Write, /) -> None: ...
    async def ask(self, request: Read | Write, /) -> list[int] | None:
        """Takes *request* to its unit, as `read` and `write` do: for what asks on behalf of a drive."""
        return await self._asked().ask(request)

    async def ask_stamped(self, request: Read, /) -> Stamped:
        """As `ask`, with the Unix times at which the request left and at which the answer was complete."""
        return await self._asked().ask_stamped(request)

    @documented_by(Requests.read)
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
        """See `Requests.read`."""
        return await self.ask(Read(unit, address, count, table, urgent, verify, timeout, retries))

    @documented_by(Requests.read_stamped)
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
        """See `Requests.read_stamped`."""
        return await self.ask_stamped(Read(unit, address, count, table, urgent, verify))

    @documented_by(Requests.write)
    async def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        halts: int | None = None,
        force: bool = False,
        table: str = "holding",
        timeout: float | None = None,
    ) -> None:
        """See `Requests.write`."""
        await self.ask(Write(unit, address, value, table, urgent, read_back, connection, halts, force, timeout))

    @documented_by(Requests.broadcast)
    async def broadcast(self, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
        """See `Requests.broadcast`."""
        await self._asked().broadcast(address, value, force=force)

    @documented_by(Requests.echo)
    async def echo(self, unit: int, word: int | None = None) -> float:
        """See `Requests.echo`."""
        return await self._asked().echo(unit, word)

    @documented_by(Requests.device_identification)
    async def device_identification(self, unit: int) -> DeviceIdentification:
        """See `Requests.device_identification`."""
        return await self._asked().device_identification(unit)

    @documented_by(Requests.transact)
    async def transact(
        self,
        unit: int,
        pdu: bytes | bytearray | memoryview,
        reply_length: int | None = None,
        *,
        force: bool = False,
    ) -> bytes:
        """See `Requests.transact`."""
        return await self._asked().transact(unit, pdu, reply_length, force=force)

    @documented_by(Requests.sleep)
    async def sleep(self, seconds: float, /) -> None:
        """See `Requests.sleep`."""
        await self._asked().sleep(seconds)

    @documented_by(Requests.listen)
    async def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """See `Requests.listen`."""
        return await self._asked().listen(seconds)

    @documented_by(Requests.link)
    async def link(self, unit: int, /) -> Link:
        """See `Requests.link`."""
        return await self._asked().link(unit)

    @documented_by(Requests.halts)
    async def halts(self, unit: int, /) -> int:
        """See `Requests.halts`."""
        return await self._asked().halts(unit)

    def scan(
        self, units: Iterable[int] = UNITS, timeout: float | None = None, *, protocol: str = "auto"
    ) -> AsyncIterator[Found]:
        """As `drivebus.Bus.scan`, for `async for`."""
        limit = scan.time_for(timeout, self.timeout)
        return self._scan(
            self._asked(), scan.units(units, self._opening.known.addresses), limit, scan.protocol_of(protocol)
        )

    async def _scan(
        self, line: AwaitedRequests, units: Sequence[int], timeout: float, protocol: str
    ) -> AsyncIterator[Found]:
        read = asking(line, timeout=timeout, retries=0)
        ask = functools.partial(line.ask_foreign, timeout=timeout)
        found: list[Found] = []
        is_first = protocol == "huanyang" and not self.stats()["requests"]
        for unit, foreign in asked(units, protocol, found):
            if foreign:
                one = await scan.look_for_huanyang(ask, self.now, unit, is_first)
            else:
                one = await scan.look_for(read, self.now, unit)
            is_first = False
            if one is not None:
                found.append(one)
                yield one

    async def identify(self, unit: int) -> Identification:
        """What the unit is, as far as it tells. As `drivebus.Bus.identify`."""
        return await identify(self.ask, self._opening.known.addresses.unit(unit))

    async def drive(
        self,
        unit: int,
        profile: str | os.PathLike[str] | Profile | None = None,
        *,
        unverified: bool = False,
        variants: Mapping[str, str] | None = None,
        trust_profile: bool = False,
        urgent: bool = False,
    ) -> Drive:
        """The drive at *unit*. Arguments and errors as in `drivebus.Bus.drive`."""
        # Over a bus that is for reading only nothing is written to whoever it is.
        unit = self._opening.known.addresses.unit(unit, changes=not self.read_only)
        check_trust(profile, trust_profile)
        known, code = await profile_of(self, unit, profile, variants, unverified, urgent)
        drive = Drive(self, unit, known, code, unverified=unverified, trust_profile=trust_profile)
        self._opening.known.add(unit, known, unverified=unverified)
        self._core().set_profile(unit, native_of(known))
        return drive

    @documented_by(BlockingFace.stop_all)
    async def stop_all(self, *, confirm: float = 1.0, within: float = WITHIN, unverified: bool = False) -> list[int]:
        """See `drivebus.Bus.stop_all`."""
        units = views(self)
        return await stop_all(units, confirm=confirm, within=within, unverified=unverified)

    @overload
    def poll(
        self, targets: Mapping[_AnyDrive, Names], interval: float | None = None, *, size: int = 10_000
    ) -> Poll[_AnyDrive]: ...
    @overload
    def poll(self, targets: Mapping[int, Reads], interval: float | None = None, *, size: int = 10_000) -> Poll[int]: ...
    @overload
    def poll(
        self, targets: Mapping[Drive | int, Names | Reads], interval: float | None = None, *, size: int = 10_000
    ) -> Poll[Drive | int]: ...
    def poll(
        self, targets: Mapping[Any, Names | Reads], interval: float | None = None, *, size: int = 10_000
    ) -> Poll[Any]:
        """As `drivebus.Bus.poll`, for `async with` and `async for`. It asks from now on, and keeps no event loop."""
        return Poll(self, self._core(), targets, interval, size)

    @property
    def line(self) -> object:
        """What stands for the line: the same for each face of it."""
        return self._core()

    def undisturbed(self) -> AbstractContextManager[AwaitableBus]:
        """The same line for a block in which nothing is given up: a cancellation is raised when the block has ended."""
        return self._asked().undisturbed()

    def blocking(self) -> BlockingBus:
        """The same line for who has no event loop: it blocks."""
        return self._asked().blocking()
