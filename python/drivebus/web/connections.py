"""Connections to the page: so many at a time, and none that says nothing. Whoever comes last has a place.

uvicorn reads HTTP from each. It waits for ever for the first request of a connection, and for who does not read.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import socket
import ssl
from typing import Any

from uvicorn import Config
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle
from uvicorn.server import ServerState

__all__ = ["MOST", "Connection", "accept"]

MOST = 200
"""Connections at a time. One more ends the oldest that nobody waits for an answer at."""
_MOST_HANDSHAKES = 50
"""So many agree on TLS at a time."""
_HEAD_WITHIN = 5.0
"""Seconds in which a request has to be there, from its first byte to the end of its head; and a handshake."""
_READ_WITHIN = 10.0
"""Seconds in which a client that has not read all has to read something."""


_NUMBERS = itertools.count()


class Connection(H11Protocol):
    """One connection.

    Attributes:
        number: It rises from one to the next.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.number = next(_NUMBERS)
        self._head: asyncio.TimerHandle | None = None
        self._unread: asyncio.TimerHandle | None = None

    @property
    def is_idle(self) -> bool:
        """Whether nobody waits for an answer here."""
        cycle: RequestResponseCycle | None = self.cycle
        return cycle is None or cycle.response_complete

    def abort(self) -> None:
        """Ends it at once, whatever is under way."""
        self.transport.abort()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """It begins."""
        super().connection_made(transport)
        self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """It is over."""
        for timer in (self._head, self._unread):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Something came."""
        super().data_received(data)
        self._await_head()

    def pause_writing(self) -> None:
        """The client does not read."""
        super().pause_writing()
        self._unread = self.loop.call_later(_READ_WITHIN, self.abort)

    def resume_writing(self) -> None:
        """It reads again."""
        super().resume_writing()
        if self._unread is not None:
            self._unread.cancel()

    def shutdown(self) -> None:
        """The page ends."""
        super().shutdown()
        # What is not read by then is not waited for.
        self.loop.call_later(0.5, self.abort)

    def timeout_keep_alive_handler(self) -> None:
        """Nothing more was asked."""
        super().timeout_keep_alive_handler()
        self.loop.call_later(_READ_WITHIN, self.abort)

    def _await_head(self) -> None:
        """Has the time of a head run while one is awaited, whatever trickles in meanwhile."""
        if not self.is_idle:
            if self._head is not None:
                self._head.cancel()
                self._head = None
        elif self._head is None:
            self._head = self.loop.call_later(_HEAD_WITHIN, self._head_is_late)

    def _head_is_late(self) -> None:
        self._head = None
        if self.is_idle:
            self.abort()


async def accept(server: socket.socket, config: Config, state: ServerState, context: ssl.SSLContext | None) -> None:
    """Takes connections at *server*, until it is cancelled."""
    loop = asyncio.get_running_loop()
    begun: set[asyncio.Task[None]] = set()

    async def begin(client: socket.socket) -> None:
        with contextlib.suppress(OSError):
            await loop.connect_accepted_socket(
                lambda: Connection(config, state, {}, loop),
                client,
                ssl=context,
                ssl_handshake_timeout=None if context is None else _HEAD_WITHIN,
            )

    while True:
        try:
            client, _ = await loop.sock_accept(server)
        except OSError:
            # No more files may be open: those that are idle end soon.
            await asyncio.sleep(0.1)
            continue
        client.setblocking(False)
        _make_room(state)
        if len(begun) >= _MOST_HANDSHAKES or len(state.connections) >= MOST:
            client.close()
            continue
        task = loop.create_task(begin(client))
        begun.add(task)
        task.add_done_callback(begun.discard)
        if context is None:
            await task


def _make_room(state: ServerState) -> None:
    """Where there are too many, ends the oldest that is idle."""
    known = [each for each in state.connections if isinstance(each, Connection)]
    idle = [each for each in known if each.is_idle]
    if len(known) >= MOST and idle:
        oldest = min(idle, key=lambda each: each.number)
        # It is told of its end a little later, and has no place until then.
        state.connections.discard(oldest)
        oldest.abort()
