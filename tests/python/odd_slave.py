"""A slave that says exactly what a case tells it to.

It is behind a pseudo-terminal, a TCP port that passes RTU through, or Modbus TCP.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from .serial_server import crc

Plan = Callable[[bytes], "bytes | list[bytes]"]
"""What is said to a request, address and PDU without a CRC: bytes, or several pieces."""


def framed(text: str) -> bytes:
    """The hexadecimal digits of *text* as bytes, and their CRC."""
    body = bytes.fromhex(text)
    return body + crc(body)


def good(request: bytes) -> bytes:
    """The right answer of a unit whose registers hold their own address."""
    unit, function = request[0], request[1]
    if function in (3, 4):
        start, count = int.from_bytes(request[2:4], "big"), int.from_bytes(request[4:6], "big")
        words = b"".join((start + at & 0xFFFF).to_bytes(2, "big") for at in range(count))
        body = bytes([unit, function, len(words)]) + words
    elif function in (6, 8):
        body = request
    elif function == 0x10:
        body = request[:6]
    else:
        body = bytes([unit, function | 0x80, 1])
    return body + crc(body)


def _ends(buffer: bytearray, start: int) -> range:
    """Where a request may end that begins at *start*: the CRC of a part of an echo may be the word that it carries."""
    last = len(buffer) + 1
    return range(start + (8 if buffer[start + 1 : start + 2] == b"\x08" else 4), last)


def _requests(buffer: bytearray) -> Iterator[bytes]:
    """The requests in *buffer*, which is left with what begins one; without their CRC, and what lies before."""
    while True:
        places = ((start, end) for start in range(len(buffer)) for end in _ends(buffer, start))
        found = ((start, end) for start, end in places if crc(bytes(buffer[start : end - 2])) == buffer[end - 2 : end])
        start, end = next(found, (0, 0))
        if not end:
            return
        yield bytes(buffer[start : end - 2])
        del buffer[:end]


@contextmanager
def on_a_terminal(plan: Plan) -> Iterator[str]:
    """Yields the path of its port."""
    master, slave = os.openpty()
    tty.setraw(master)
    tty.setraw(slave)
    waker, wake = os.pipe()

    def serve() -> None:
        buffer = bytearray()
        while True:
            ready, _, _ = select.select([master, waker], [], [])
            if waker in ready:
                return
            with suppress(OSError):
                buffer += os.read(master, 512)
            for request in _requests(buffer):
                said = plan(request)
                for piece in said if isinstance(said, list) else [said]:
                    os.write(master, piece)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        os.write(wake, b".")
        thread.join()
        for each in (master, slave, waker, wake):
            os.close(each)


@contextmanager
def on_a_socket(
    plan: Plan, *, mbap: bool = False, greeting: bytes = b"", number: Callable[[int], int] = int, close: bool = False
) -> Iterator[str]:
    """Yields its URL.

    *mbap*: it speaks Modbus TCP, and gives the transaction *number* back; *close*: it hangs up after each answer.
    """
    listener = socket.create_server(("127.0.0.1", 0))
    over = threading.Event()

    def serve() -> None:
        while not over.is_set():
            try:
                client, _ = listener.accept()
            except OSError:
                return
            with client, suppress(OSError):
                client.sendall(greeting)
                _serve_one(client)

    def _serve_one(client: socket.socket) -> None:
        buffer = bytearray()
        while not over.is_set() and (data := client.recv(512)):
            buffer += data
            asked = list(_requests_in_mbap(buffer)) if mbap else [(0, each) for each in _requests(buffer)]
            for transaction, request in asked:
                said = plan(request)
                for piece in said if isinstance(said, list) else [said]:
                    client.sendall(_headed(number(transaction), piece) if mbap else piece)
                if close:
                    return

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield f"{'tcp' if mbap else 'socket'}://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        over.set()
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def _requests_in_mbap(buffer: bytearray) -> Iterator[tuple[int, bytes]]:
    while len(buffer) >= 6 and len(buffer) >= 6 + (length := int.from_bytes(buffer[4:6], "big")):
        yield int.from_bytes(buffer[:2], "big"), bytes(buffer[6 : 6 + length])
        del buffer[: 6 + length]


def _headed(transaction: int, frame: bytes) -> bytes:
    """A frame as Modbus TCP carries it."""
    body = frame[:-2]
    return (transaction & 0xFFFF).to_bytes(2, "big") + bytes(2) + len(body).to_bytes(2, "big") + body
