"""A client of Modbus TCP by the byte: what it sends and hears is what the test says."""

from __future__ import annotations

import contextlib
import itertools
import os
import socket
import struct
import threading
from collections.abc import Callable

from drivebus import Gateway

HERE = "127.0.0.1:0"

_ports = itertools.count()


def free_port() -> int:
    """A port for a server whose number a file has to name.

    It lies below those that a system gives to programs that name none (32 768 and up on Linux), and each worker has
    its own thousand: nobody else takes it before the server does.
    """
    first = 20_000 + 1_000 * (int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:]) % 12)
    while True:
        port = first + next(_ports) % 1_000
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port


def connected(gateway: Gateway, source: str = "127.0.0.1") -> socket.socket:
    host, port = gateway.address.rsplit(":", 1)
    return socket.create_connection((host, int(port)), timeout=20, source_address=(source, 0))


def request(transaction: int, unit: int, pdu: bytes) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def exactly(client: socket.socket, count: int) -> bytes:
    came = b""
    while len(came) < count:
        piece = client.recv(count - len(came))
        if not piece:
            raise EOFError(came)
        came += piece
    return came


def answer(client: socket.socket) -> tuple[int, int, bytes]:
    transaction, protocol, length, unit = struct.unpack(">HHHB", exactly(client, 7))
    assert protocol == 0
    return transaction, unit, exactly(client, length - 1)


def seen(condition: Callable[[], bool]) -> None:
    """Waits, in the time of other threads, until *condition* holds."""
    while not condition():
        threading.Event().wait(0.001)


def is_cut_off(client: socket.socket) -> bool:
    try:
        return client.recv(1) == b""
    except ConnectionResetError:
        return True
