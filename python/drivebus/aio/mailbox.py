"""What the threads of the compiled core have for one event loop: one socket to watch, and the futures that wait.

However many buses a loop has, one wake-up delivers everything that has come for it.
"""

from __future__ import annotations

import asyncio
import socket
import threading
import weakref
from typing import Any, TypeVar

from drivebus import _native

__all__ = ["Mailbox"]

_T = TypeVar("_T")

_mailboxes: weakref.WeakKeyDictionary[asyncio.AbstractEventLoop, Mailbox] = weakref.WeakKeyDictionary()
_lock = threading.Lock()


class Mailbox:
    """The mailbox of one event loop, which must be the running one. It lasts as long as the loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.native = _native.Mailbox()
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._watched = True
        self._listener: asyncio.Task[None] | None = None
        try:
            loop.add_reader(self.native.fileno(), self._deliver)
        except NotImplementedError:
            # The proactor of Windows tells of no descriptor, but reads from sockets.
            self._watched = False

    @classmethod
    def here(cls, loop: asyncio.AbstractEventLoop) -> Mailbox:
        """The one of *loop*, made at need."""
        with _lock:
            mailbox = _mailboxes.get(loop)
            if mailbox is None:
                # What a loop left behind that was closed with requests open would keep it for ever.
                for other in [other for other in _mailboxes if other.is_closed()]:
                    _mailboxes.pop(other)._waiting.clear()
                mailbox = _mailboxes[loop] = cls(loop)
        return mailbox

    async def wait(self, asked: _native.Asked[_T]) -> _T:
        """What comes of *asked*. Who is cancelled here does not want it any more."""
        future = self._expect(asked)
        try:
            return await future
        except (asyncio.CancelledError, GeneratorExit):
            self._waiting.pop(asked.number, None)
            asked.abandon()
            raise
        finally:
            self._rest()

    async def wait_undisturbed(self, asked: _native.Asked[_T], cancelled: list[BaseException]) -> _T:
        """What comes of *asked*, whoever cancels it meanwhile: that is put into *cancelled*."""
        future = self._expect(asked)
        while not future.done():
            try:
                await asyncio.wait([future])
            except asyncio.CancelledError as error:
                cancelled.append(error)
        self._rest()
        return future.result()

    def _expect(self, asked: _native.Asked[_T]) -> asyncio.Future[_T]:
        loop = asyncio.get_running_loop()
        future: asyncio.Future[_T] = loop.create_future()
        self._waiting[asked.number] = future
        if not self._watched and (self._listener is None or self._listener.done()):
            self._listener = loop.create_task(self._listen(loop))
        return future

    def _deliver(self) -> None:
        for number, value, error in self.native.take():
            future = self._waiting.pop(number, None)
            if future is None or future.done():
                continue  # nobody wants it any more
            if error is None:
                future.set_result(value)
            else:
                future.set_exception(error)

    async def _listen(self, loop: asyncio.AbstractEventLoop) -> None:
        with socket.socket(fileno=self.native.detach_socket()) as heard:
            heard.setblocking(False)
            # What came while nobody listened rings no more.
            self._deliver()
            while await loop.sock_recv(heard, 64):
                self._deliver()

    def _rest(self) -> None:
        if self._listener is not None and not self._waiting:
            self._listener.cancel()
            self._listener = None
