"""A server, RTU over TCP or Modbus TCP, that closes its connections when a case says so; and one before others."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

from .odd_slave import good
from .serial_server import crc, requests_of

RESET = struct.pack("ii", 1, 0)
"""`SO_LINGER` by which a socket that is closed says so by a reset."""


@dataclass
class ClosingServer:
    """What it was asked, and how it answers: address and PDU, without header and CRC.

    Attributes:
        mbap: Whether it speaks Modbus TCP.
        ends: How many bytes of its answer to the request of this number (from 0) it sends before it closes; None: all
            of it, and the connection stays open; -1: all of it.
        reset: Whether it closes by a reset.
        asked: Each request that came, in order.
        clients: How many connections there were.
    """

    mbap: bool = False
    ends: Callable[[int], int | None] = lambda _: -1
    reset: bool = False
    asked: list[bytes] = field(default_factory=list)
    clients: int = 0
    url: str = ""
    _client: socket.socket | None = None

    def writes(self) -> list[bytes]:
        """The requests by which something is written."""
        return [request for request in self.asked if request[1] in (5, 6, 16)]

    def hang_up(self) -> None:
        """Closes the connection that is open, as a server does that was not asked for long."""
        if self._client is not None:
            self._client.shutdown(socket.SHUT_RDWR)

    def serve(self, listener: socket.socket) -> None:
        """Until the listener is closed."""
        while True:
            try:
                client, _ = listener.accept()
            except OSError:
                return
            self.clients += 1
            self._client = client
            with client, suppress(OSError):
                self._talk(client)
                if self.reset:
                    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)

    def _talk(self, client: socket.socket) -> None:
        buffer = bytearray()
        while data := client.recv(512):
            buffer += data
            for head, body in self._requests(buffer):
                number = len(self.asked)
                self.asked.append(body)
                answer = self._answer(head, body)
                end = self.ends(number)
                client.sendall(answer if end in (None, -1) else answer[:end])
                if end is not None:
                    return

    def _requests(self, buffer: bytearray) -> Iterator[tuple[bytes, bytes]]:
        """Takes the requests out of *buffer*: the transaction of each, and address and PDU."""
        if not self.mbap:
            yield from ((b"", request[:-2]) for request in requests_of(buffer))
            return
        while len(buffer) >= 6 and len(buffer) >= (size := 6 + int.from_bytes(buffer[4:6], "big")):
            whole = bytes(buffer[:size])
            del buffer[:size]
            yield whole[:2], whole[6:]

    def _answer(self, head: bytes, body: bytes) -> bytes:
        said = good(body)
        return head + bytes(2) + (len(said) - 2).to_bytes(2, "big") + said[:-2] if self.mbap else said


@contextmanager
def closing_server(server: ClosingServer) -> Iterator[ClosingServer]:
    """It listens on this machine meanwhile."""
    with _served(server.serve) as port:
        server.url = f"{'tcp' if server.mbap else 'socket'}://127.0.0.1:{port}"
        yield server


@contextmanager
def closing_before(host: str, port: int) -> Iterator[int]:
    """The port of one that hands each request on to the server at *host*, and closes behind its answer."""

    def serve(listener: socket.socket) -> None:
        with socket.create_connection((host, port)) as behind:
            while True:
                try:
                    client, _ = listener.accept()
                except OSError:
                    return
                with client, suppress(OSError):
                    if request := client.recv(512):
                        behind.sendall(request)
                        client.sendall(_whole(behind))

    with _served(serve) as ours:
        yield ours


def _whole(behind: socket.socket) -> bytes:
    """The next answer, however it comes."""
    answer = behind.recv(512)
    while crc(answer[:-2]) != answer[-2:]:
        answer += behind.recv(512)
    return answer


@contextmanager
def _served(serve: Callable[[socket.socket], None]) -> Iterator[int]:
    listener = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=serve, args=(listener,), daemon=True)
    thread.start()
    try:
        yield listener.getsockname()[1]
    finally:
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()
