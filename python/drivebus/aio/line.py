"""The compiled core's bus with calls that are awaited: the same arguments, and an answer when there is one."""

from __future__ import annotations

import asyncio
import functools
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Concatenate, ParamSpec, TypeVar

from drivebus import _native
from drivebus.aio.mailbox import Mailbox

__all__ = ["Line"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


def _awaited(
    ask: Callable[Concatenate[_native.Requests, _P], _native.Asked[_R]],
) -> Callable[Concatenate[Line, _P], Coroutine[Any, Any, _R]]:
    """The call that asks with the first step of its coroutine, and waits for what comes."""

    @functools.wraps(ask)
    async def call(line: Line, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        mailbox, requests = line._here()
        return await line._wait(mailbox, ask(requests, *args, **kwargs))

    return call


class Line:
    """A bus of the core, for whichever event loop uses it.

    Args:
        native: The bus.
        cancelled: Where cancellations are put, so that nothing that was asked is given up. None: it is given up.
    """

    def __init__(self, native: _native.Bus, cancelled: list[BaseException] | None = None) -> None:
        self.native = native
        self._cancelled = cancelled
        self._used_here: tuple[asyncio.AbstractEventLoop, Mailbox, _native.Requests] | None = None

    @classmethod
    async def open(cls, target: object, line: _native.SerialFormat, keywords: dict[str, Any]) -> Line:
        """Opens *target* without keeping the event loop, however long that takes."""
        mailbox = Mailbox.here(asyncio.get_running_loop())
        return cls(await mailbox.wait(_native.open_bus(mailbox.native, target, line, **keywords)))

    @property
    def port(self) -> str:
        """See `_native.Bus`, as of all else here."""
        return self.native.port

    @property
    def closed(self) -> bool:
        """See `_native.Bus`."""
        return self.native.closed

    @property
    def read_only(self) -> bool:
        """See `_native.Bus`."""
        return self.native.read_only

    @property
    def reconnects(self) -> int:
        """See `_native.Bus`."""
        return self.native.reconnects

    def now(self) -> float:
        """See `_native.Bus`."""
        return self.native.now()

    def stats(self) -> dict[str, Any]:
        """See `_native.Bus`."""
        return self.native.stats()

    def configure(self, unit: int, /, *, timeout: float | None = None, gap: float | None = None) -> None:
        """See `_native.Bus`."""
        self.native.configure(unit, timeout=timeout, gap=gap)

    read = _awaited(_native.Requests.read)
    read_stamped = _awaited(_native.Requests.read_stamped)
    write = _awaited(_native.Requests.write)
    broadcast = _awaited(_native.Requests.broadcast)
    echo = _awaited(_native.Requests.echo)
    transact = _awaited(_native.Requests.transact)
    link = _awaited(_native.Requests.link)
    halts = _awaited(_native.Requests.halts)
    listen = _awaited(_native.Requests.listen)
    close = _awaited(_native.Requests.close)
    _sleep = _awaited(_native.Requests.sleep)

    async def sleep(self, seconds: float, /) -> None:
        """See `_native.Bus`."""
        if self.native.virtual or self._cancelled is not None:
            # A simulation's time moves only while somebody waits on its line.
            await self._sleep(seconds)
        else:
            await asyncio.sleep(seconds)

    @contextmanager
    def undisturbed(self) -> Iterator[Line]:
        """The same for a block in which nothing is given up. A cancellation is raised at its end."""
        cancelled: list[BaseException] = []
        with _shielded():
            try:
                yield Line(self.native, cancelled)
            except Exception as error:
                if cancelled:
                    raise cancelled[-1] from error
                raise
        if cancelled:
            raise cancelled[-1]

    def _here(self) -> tuple[Mailbox, _native.Requests]:
        loop = asyncio.get_running_loop()
        known = self._used_here
        if known is None or known[0] is not loop:
            mailbox = Mailbox.here(loop)
            self._used_here = known = (loop, mailbox, _native.Requests(self.native, mailbox.native))
        return known[1:]

    async def _wait(self, mailbox: Mailbox, asked: _native.Asked[_R]) -> _R:
        if self._cancelled is None:
            return await mailbox.wait(asked)
        return await mailbox.wait_undisturbed(asked, self._cancelled)


def _shielded() -> AbstractContextManager[object]:
    """Keeps anyio, where the program uses it, from cancelling again with each step of the event loop."""
    anyio = sys.modules.get("anyio")
    return nullcontext() if anyio is None else anyio.CancelScope(shield=True)
