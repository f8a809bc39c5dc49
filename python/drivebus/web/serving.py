"""Serves the page at one address, in a thread of its own, until it is closed."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
import threading
from collections.abc import Iterable

import uvicorn

from drivebus.errors import PortError
from drivebus.web.app import Routes
from drivebus.web.connections import accept
from drivebus.web.guard import Guard
from drivebus.web.log_in import LogIn
from drivebus.web.sessions import Sessions
from drivebus.web.shown import Shown
from drivebus.web.signed import Cookie, Signed

__all__ = ["Web"]

_HEAD = 16_384
"""Bytes of the head of a request."""
_KEEP_ALIVE = 5
"""Seconds for which a connection waits for another request."""
_ENDS_WITHIN = 5.0
"""Seconds for which the end of the thread is waited for."""
_LOOPBACK = ("localhost", "127.0.0.1", "::1")


class Web:
    """The page, until it is closed.

    Args:
        address: `host:port`.
        hosts: The names that it is asked for by; none: those of the address and of this computer.
        context: TLS, or None, which is for loopback alone.
        shown: What it shows, and what may be ordered.

    Raises:
        PortError: It cannot listen there.
    """

    def __init__(self, address: str, hosts: Iterable[str], context: ssl.SSLContext | None, shown: Shown) -> None:
        name, _, port = address.rpartition(":")
        host = name.strip("[]")
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, int(port)), family=family, backlog=128)
        except OSError as error:
            raise PortError(f"{address}: nothing can listen there: {error.strerror or error}") from None
        self._socket.setblocking(False)
        self.port: int = self._socket.getsockname()[1]
        known = {each.lower().strip("[]") for each in hosts} or {host.lower(), *_LOOPBACK}
        people = {person.name: person for person in shown.people}
        sessions, cookie = Sessions(), Cookie(context is not None, self.port)
        self._log_in = LogIn(people, shown.tell)
        self._routes = Routes(shown, sessions, cookie, self._log_in)
        app = Guard(Signed(self._routes.app, sessions, cookie, people), known, shown.tell)
        config = uvicorn.Config(
            app,
            http="h11",
            ws="none",
            loop="asyncio",
            lifespan="off",
            log_config=None,
            log_level="critical",
            access_log=False,
            proxy_headers=False,
            server_header=False,
            timeout_keep_alive=_KEEP_ALIVE,
            timeout_graceful_shutdown=1,
            h11_max_incomplete_event_size=_HEAD,
        )
        self._context = context
        self._config = config
        self._server = uvicorn.Server(config)
        self._loop = asyncio.new_event_loop()
        self._ends = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with contextlib.closing(self._loop):
            self._loop.run_until_complete(self._serve())
            self._loop.run_until_complete(self._loop.shutdown_asyncgens())
            self._loop.run_until_complete(self._loop.shutdown_default_executor())

    async def _serve(self) -> None:
        self._config.load()
        # Connections say what they talk over: uvicorn listens at nothing by itself.
        tasks = [
            asyncio.create_task(accept(self._socket, self._config, self._server.server_state, self._context)),
            asyncio.create_task(self._routes.live.run()),
        ]
        serving = asyncio.create_task(self._server.serve(sockets=[]))
        ends = asyncio.create_task(self._ends.wait())
        await asyncio.wait([*tasks, serving, ends], return_when=asyncio.FIRST_COMPLETED)
        for task in [*tasks, ends]:
            task.cancel()
        await self._routes.live.end()
        self._server.should_exit = True
        await asyncio.gather(*tasks, ends, serving, return_exceptions=True)

    @property
    def serves(self) -> bool:
        """Whether it does."""
        return self._thread.is_alive()

    def close(self) -> None:
        """Listens no more; what is under way is ended."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._ends.set)
        self._thread.join(_ENDS_WITHIN)
        self._socket.close()
        self._log_in.close()
        self._routes.close()
