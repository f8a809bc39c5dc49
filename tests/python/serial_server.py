"""A serial server as many are: it takes the requests of all its clients in turn, and copies every answer to all."""

from __future__ import annotations

import contextlib
import queue
import socket
import struct
import threading
from collections.abc import Iterable, Iterator

UNIT = 1
# The register in the lower bits of a word, the number of the answer above: each word tells which question it answers.
PLACES = 1 << 10
END = 0x300  # no register from here on
READ, WRITE, LOOP_BACK, WRITE_MANY = 0x03, 0x06, 0x08, 0x10
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 0x01, 0x02
DELAY = 0.003  # seconds that the unit takes


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, low byte first, bit by bit."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register.to_bytes(2, "little")


def frame(unit: int, pdu: bytes) -> bytes:
    """The PDU as it is on the wire."""
    body = bytes([unit]) + pdu
    return body + crc(body)


def place_of(word: int) -> int:
    """The register that a word was read from."""
    return word % PLACES


class SerialServer:
    """Listens on 127.0.0.1 while it is entered. `asked`: the requests in order, with the number of their client."""

    def __init__(self, *, loop_back: bool = True, end: int = END, delay: float = DELAY) -> None:
        self.asked: list[tuple[int, bytes]] = []
        self.kept: dict[int, int] = {}
        self._loop_back = loop_back
        self._end = end
        self._delay = delay
        self._requests: queue.SimpleQueue[tuple[int, bytes] | None] = queue.SimpleQueue()
        self._clients: list[socket.socket] = []
        self._over = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]
        self.url = f"socket://127.0.0.1:{self.port}"

    def __enter__(self) -> SerialServer:
        for work in (self._accept, self._answer):
            threading.Thread(target=work, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._requests.put(None)
        for each in (self._listener, *self._clients):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def say(self, unit: int, pdu: bytes) -> None:
        """A frame comes over the line, whoever asked for it."""
        self._copy_to_all(frame(unit, pdu))

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._clients.append(client)
                threading.Thread(target=self._take, args=(len(self._clients), client), daemon=True).start()

    def _take(self, number: int, client: socket.socket) -> None:
        received = bytearray()
        with contextlib.suppress(OSError):
            while came := client.recv(4096):
                received += came
                for request in requests_of(received):
                    self._requests.put((number, request))

    def _answer(self) -> None:
        count = 0
        while (asked := self._requests.get()) is not None:
            self.asked.append(asked)
            unit, pdu = asked[1][0], asked[1][1:-2]
            count += 1
            self._over.wait(self._delay)  # the unit is at work
            answer = self._pdu(pdu, count)
            if unit == UNIT and answer:
                self.say(unit, answer)

    def _pdu(self, pdu: bytes, count: int) -> bytes:
        function, address, number = struct.unpack(">BHH", pdu[:5])
        if function == LOOP_BACK:
            return pdu if self._loop_back else b""
        words = number if function in (READ, WRITE_MANY) else 1
        if address + words > self._end:
            return bytes([function | 0x80, ILLEGAL_ADDRESS])
        if function == READ:
            read = [self.kept.get(place, place + PLACES * (count % 64)) for place in range(address, address + words)]
            return struct.pack(f">BB{words}H", function, 2 * words, *read)
        if function == WRITE:
            self.kept[address] = number
            return pdu
        if function == WRITE_MANY:
            self.kept.update(enumerate(struct.unpack(f">{words}H", pdu[6:]), address))
            return pdu[:5]
        return bytes([function | 0x80, ILLEGAL_FUNCTION])

    def _copy_to_all(self, answer: bytes) -> None:
        for client in list(self._clients):
            with contextlib.suppress(OSError):
                client.sendall(answer)


def requests_of(received: bytearray) -> Iterator[bytes]:
    """Takes the whole requests out of *received*."""
    while len(received) >= 8:
        size = 9 + received[6] if received[1] == WRITE_MANY else 8
        if len(received) < size:
            return
        yield bytes(received[:size])
        del received[:size]


class Foreign:
    """Another master, which asks one after the other and takes whatever comes for its answer, until it is left."""

    def __init__(self, server: SerialServer, pdus: Iterable[bytes], pause: float = 0.0) -> None:
        self._socket = socket.create_connection(("127.0.0.1", server.port))
        self._frames = [frame(UNIT, pdu) for pdu in pdus]
        self._pause = pause
        self._over = threading.Event()
        self._begun = threading.Event()
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._thread.start()
        self._begun.wait(10)

    def __enter__(self) -> Foreign:
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(10)
        self._socket.close()

    def _ask(self) -> None:
        self._socket.settimeout(0.5)
        while True:
            for each in self._frames:
                if self._over.wait(self._pause) if self._pause else self._over.is_set():
                    return
                self._socket.sendall(each)
                with contextlib.suppress(TimeoutError):
                    self._socket.recv(4096)
                self._begun.set()


def read_pdu(address: int, count: int) -> bytes:
    """A read of holding registers."""
    return struct.pack(">BHH", READ, address, count)
