"""A line with units on it, for asyncio. What each call checks and asks is what `drivebus.Bus` checks and asks."""

from __future__ import annotations

import copy
import functools
import os
from collections.abc import AsyncIterator, Callable, Coroutine, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from drivebus import bus, checks
from drivebus._native import SerialFormat
from drivebus.aio.drive import Drive
from drivebus.aio.line import Line
from drivebus.aio.poll import Poll
from drivebus.at_once import BlockingBus
from drivebus.errors import PortError
from drivebus.figures import Link
from drivebus.identify import scan
from drivebus.identify.choose import profile_of
from drivebus.identify.identify import identify
from drivebus.identify.results import Found, Identification
from drivebus.opening import BusFace, Opening, check_trust
from drivebus.profile import Profile
from drivebus.safeguard import end_over

__all__ = ["Bus"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


def _awaited(method: Callable[Concatenate[bus.Bus, _P], _R]) -> Callable[Concatenate[Bus, _P], Coroutine[Any, Any, _R]]:
    """The synchronous method over a line whose calls are awaited: it checks, asks, and returns what comes."""

    @functools.wraps(method)
    async def call(face: Bus, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        face._check_open()
        work: Any = method(face, *args, **kwargs)  # type: ignore[arg-type]  # all that it uses is here
        result: _R = await work
        return result

    return call


class Bus(BusFace[Line]):
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

    def __init__(
        self,
        port: object,
        *,
        baudrate: int = 19200,
        parity: str = "E",
        stopbits: int = 1,
        bytesize: int = 8,
        silence: str | float = "spec",
        timeout: float = 0.5,
        retries: int = 2,
        read_only: bool = False,
        rs485: Mapping[str, object] | None = None,
        echo: str = "auto",
        turnaround: float = 0.1,
        learn_timeout: bool = False,
        low_latency: bool = True,
        queue: int = 65_536,
    ) -> None:
        self._opening = Opening(
            port,
            SerialFormat(baudrate, parity, stopbits, bytesize, silence),
            timeout=timeout,
            retries=retries,
            read_only=read_only,
            rs485=rs485,
            echo=echo,
            turnaround=turnaround,
            learn_timeout=learn_timeout,
            low_latency=low_latency,
            queue=queue,
        )
        self._shown = str(port)

    @classmethod
    async def open(cls, port: object, **keywords: Any) -> Bus:
        """Opens *port*; the keywords are those of the class."""
        return await cls(port, **keywords)

    def __await__(self) -> Generator[Any, None, Bus]:
        return self.__aenter__().__await__()

    async def _open(self) -> Bus:
        try:
            line = await Line.open(self._opening.target, self._opening.format, self._opening.keywords)
        except BaseException:
            if self._opening.owned is not None:
                self._opening.owned.close()
            raise
        super().__init__(self._opening, line)
        return self

    async def __aenter__(self) -> Bus:
        return self if self._is_open else await self._open()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    @property
    def _is_open(self) -> bool:
        return "_native" in self.__dict__

    if not TYPE_CHECKING:  # a type checker knows what there is

        def __getattr__(self, name: str) -> Any:
            # What is missing before the bus was opened is there afterwards.
            if not self._is_open and not name.startswith("__"):
                self._check_open()
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def _check_open(self) -> None:
        if not self._is_open:
            raise PortError(f"{self._shown} is not open yet; say `async with Bus(…) as bus:` or `await Bus.open(…)`")

    def __repr__(self) -> str:
        return super().__repr__() if self._is_open else f"<Bus on {self._shown}, not open yet>"

    async def close(self) -> None:
        """Closes the port, and ends a simulator that this bus made. Closing again does nothing.

        A motor that a block of another task runs over it is stopped before. What still waits for the line ends with
        `PortError`.
        """
        if not self._is_open:
            return
        end_over(self.line)
        with self._native.undisturbed() as line:
            await line.close()
            if self._owned is not None:
                self._owned.close()

    read = _awaited(bus.Bus.read)
    read_stamped = _awaited(bus.Bus.read_stamped)
    write = _awaited(bus.Bus.write)
    broadcast = _awaited(bus.Bus.broadcast)
    echo = _awaited(bus.Bus.echo)
    transact = _awaited(bus.Bus.transact)
    sleep = _awaited(bus.Bus.sleep)
    listen = _awaited(bus.Bus.listen)

    async def link(self, unit: int, /) -> Link:
        """How well *unit* could be reached: of its last exchanges, ten at most, how many brought an answer."""
        self._check_open()
        return Link(*await self._native.link(checks.unit(unit)))

    def scan(self, units: Iterable[int] = range(1, 248), timeout: float | None = None) -> AsyncIterator[Found]:
        """As `drivebus.Bus.scan`, for `async for`."""
        self._check_open()
        return self._scan(scan.units(units), scan.time_for(timeout, self._timeout))

    async def _scan(self, units: Iterable[int], timeout: float) -> AsyncIterator[Found]:
        async def read(unit: int, address: int) -> list[int]:
            return await self._native.read(unit, address, 1, timeout=timeout, retries=0)  # type: ignore[no-any-return]

        for unit in units:
            found = await scan.look_for(read, self.now, unit)
            if found is not None:
                yield found

    async def identify(self, unit: int) -> Identification:
        """What the unit is, as far as it tells. As `drivebus.Bus.identify`."""
        return await identify(self.read, checks.unit(unit))

    async def drive(
        self,
        unit: int,
        profile: str | os.PathLike[str] | Profile | None = None,
        *,
        unverified: bool = False,
        variants: Mapping[str, str] | None = None,
        trust_profile: bool = False,
    ) -> Drive:
        """The drive at *unit*. Arguments and errors as in `drivebus.Bus.drive`."""
        unit = checks.unit(unit)
        check_trust(profile, trust_profile)
        known, code = await profile_of(self, unit, profile, variants, unverified)
        drive = Drive(self, unit, known, code, unverified=unverified, trust_profile=trust_profile)
        self._known.add(unit, known)
        return drive

    def poll(self, targets: Mapping[Any, Any], interval: float | None = None, *, size: int = 10_000) -> Poll:
        """As `drivebus.Bus.poll`, for `async with` and `async for`. It asks from now on, and keeps no event loop."""
        self._check_open()
        return Poll(self, self._native.native, targets, interval, size)

    @property
    def line(self) -> object:
        """What stands for the line: the same for each face of it."""
        return self._native.native

    @contextmanager
    def undisturbed(self) -> Iterator[Bus]:
        """The same line for a block in which nothing is given up: a cancellation is raised when the block has ended."""
        with self._native.undisturbed() as line:
            other = copy.copy(self)
            other._native = line
            yield other

    def blocking(self) -> BlockingBus:
        """The same line for who has no event loop: it blocks."""
        return BlockingBus(bus.Bus.around(self._opening, self._native.native))
