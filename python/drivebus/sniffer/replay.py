"""Units that answer as those of a capture did."""

from __future__ import annotations

import os
import select
import socket
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable
from functools import partial
from types import TracebackType

from drivebus import checks
from drivebus._native import SerialFormat, frame_len
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, NotAllowed
from drivebus.latch import Latch
from drivebus.rtu import is_frame
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.register_history import Seen

__all__ = ["Replay"]

_LOOK_UP = 0.2
_CHUNK = 4096
_ECHO = 0x08


class Replay:
    """Serves the answers of *exchanges* on a pseudo-terminal or over TCP, until it is closed.

    Each request gets the answers that it got, in their order, and then the last of them again and again. A read (03H)
    that is not there gets the words that its registers had by then, if all of them were read there. An echo (08H) of a
    unit that answered anything is returned: its word is new each time. Answers come at once, after the silence that
    frames need.

    Args:
        exchanges: What was heard; what answers nothing is passed over.
        line: How characters look, for the silence between frames.
        transport: `"pty"`, `"tcp"`, or `"auto"`: the first of them that this system has.
        told: Is called with each request that cannot be answered, from another thread.

    Raises:
        NotAllowed: No exchange has an answer, or this system has no pseudo-terminals.

    Attributes:
        port: What a program opens: a path, or `socket://127.0.0.1:…`.
        unknown: Requests that came and could not be answered from the capture.
    """

    def __init__(
        self,
        exchanges: Iterable[Exchange],
        line: SerialFormat,
        transport: str = "auto",
        told: Callable[[bytes], object] | None = None,
    ) -> None:
        checks.one_of("transport", transport, ("auto", "pty", "tcp"))
        self._answers: dict[bytes, deque[tuple[int, bytes | None]]] = {}
        known = list(exchanges)
        for at, exchange in enumerate(known):
            if exchange.request is not None:
                self._answers.setdefault(exchange.request, deque()).append((at, exchange.answer))
        self._units = {exchange.request[0] for exchange in known if exchange.request and exchange.answer}
        if not self._units:
            raise BadArgument("no request in the capture has an answer: there is nothing to replay")
        # Who left an echo without an answer there leaves any.
        self._silent = {request[0] for request in self._answers if request[1] == _ECHO} - self._units
        self._seen = Seen(known)
        # The number of the exchange that the replay has come to.
        self._now = -1
        self._told = told
        self._line = line
        self.unknown: set[bytes] = set()
        self._over = Latch()
        # Not a pipe: Windows waits for sockets alone.
        self._wake, self._woken = socket.socketpair()
        self._server: socket.socket | None = None
        self._descriptors: list[int] = []
        self.port: str
        if transport == "tcp" or (transport == "auto" and sys.platform == "win32"):
            self._open_tcp()
        else:
            self._open_pty()
        self._thread = threading.Thread(target=self._serve, name="drivebus replay", daemon=True)
        self._thread.start()

    def wait(self, timeout: float | None = None) -> None:
        """Waits until it is closed, for *timeout* seconds at most."""
        self._over.wait(timeout)

    def close(self) -> None:
        """Ends it."""
        if not self._over.is_set():
            self._over.set()
            self._woken.send(b"!")
            self._thread.join()
            self._wake.close()
            self._woken.close()
            for descriptor in self._descriptors:
                os.close(descriptor)
            if self._server is not None:
                self._server.close()

    def __enter__(self) -> Replay:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _open_pty(self) -> None:
        if sys.platform == "win32":
            raise NotAllowed(Text("this system has no pseudo-terminals; say ", argument("transport", "tcp")))
        import tty

        ours, theirs = os.openpty()
        tty.setraw(theirs)
        self._descriptors = [ours, theirs]
        self.port = os.ttyname(theirs)

    def _open_tcp(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = "socket://{}:{}".format(*self._server.getsockname())

    def _serve(self) -> None:
        """Answers whoever asks, one after the other."""
        if self._server is None:
            terminal = self._descriptors[0]
            self._talk(terminal, partial(os.read, terminal), partial(os.write, terminal))
            return
        wake = self._wake.fileno()
        while not self._over.is_set():
            ready, _, _ = select.select([self._server.fileno(), wake], [], [])
            if wake in ready:
                return
            client, _ = self._server.accept()
            with client:
                self._talk(client.fileno(), client.recv, client.sendall)

    def _talk(self, descriptor: int, read: Callable[[int], bytes], write: Callable[[bytes], object]) -> None:
        heard = b""
        wake = self._wake.fileno()
        while not self._over.is_set():
            ready, _, _ = select.select([descriptor, wake], [], [], _LOOK_UP)
            if wake in ready:
                return
            if not ready:
                heard = b""
                continue
            try:
                came = read(_CHUNK)
            except OSError:
                return
            if not came:
                return
            heard = self._answer_all(write, heard + came)

    def _answer_all(self, write: Callable[[bytes], object], heard: bytes) -> bytes:
        """Answers the requests in *heard*; returns what is none yet."""
        while (request := _first_frame(heard)) is not None:
            heard = heard[heard.index(request) + len(request) :]
            answer = self._answer(request)
            if answer is not None:
                threading.Event().wait(self._line.t35)
                try:
                    write(answer)
                except OSError:
                    return b""
        return heard

    def _answer(self, request: bytes) -> bytes | None:
        answers = self._answers.get(request)
        if answers is not None:
            at, answer = answers.popleft() if len(answers) > 1 else answers[0]
            self._now = max(self._now, at)
            return answer
        if request[1] == _ECHO and request[0] in self._units:
            return request
        if request[1] == _ECHO and request[0] in self._silent:
            return None
        answer = self._seen.answer(request, self._now)
        if answer is None:
            self.unknown.add(request)
            if self._told is not None:
                self._told(request)
        return answer


def _first_frame(heard: bytes) -> bytes | None:
    """The first whole frame in *heard*; of a function that tells no length, all from its first byte on."""
    for start in range(len(heard) - 3):
        rest = heard[start:]
        frame = rest[: frame_len(rest)]
        if is_frame(frame):
            return frame
    return None
