"""The client that judges a gateway: bytes of a socket, and nothing is believed that the specification does not say.

Whatever comes must name a transaction that is open, its unit and its function, and bring as many values as were asked
for, and these values. Who asks knows them: the slave's register *a* holds *a*. An answer may come after the client has
given its transaction up, if it is that transaction's own; a second answer to one transaction is wrong.

Source: MODBUS Messaging on TCP/IP Implementation Guide V1.0b, 3.1.3.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from .. import wire
from ..child import BOUND, Outcome
from ..slave import UNIT
from ..verdict import ERROR, RIGHT, WRONG

NONE = "none"
"""How a transaction ended to which no answer came in time."""

HEADER = struct.Struct(">HHHB")


@dataclass(frozen=True)
class End:
    """How one transaction ended."""

    kind: str
    detail: str = ""


@dataclass(frozen=True)
class _Asked:
    unit: int
    pdu: bytes
    values: Sequence[int]  # of a read


@dataclass
class Tally:
    """How transactions ended, and what else came."""

    ends: Counter[str] = field(default_factory=Counter)
    details: Counter[str] = field(default_factory=Counter)

    def add(self, end: End) -> None:
        self.ends[end.kind] += 1
        if end.detail:
            self.details[f"{end.kind}: {end.detail}"] += 1

    def __add__(self, other: Tally) -> Tally:
        return Tally(self.ends + other.ends, self.details + other.details)


class Client:
    """One connection, made again where the gateway ends it. `tally` has how all transactions ended."""

    def __init__(self, address: str, timeout: float = BOUND, source: str = "") -> None:
        host, _, port = address.rpartition(":")
        self._to, self._from = (host, int(port)), (source, 0) if source else None
        self.timeout = timeout
        self.tally = Tally()
        self._next = 0
        self._open: dict[int, _Asked] = {}
        self._answered: set[int] = set()
        self._socket: socket.socket | None = None
        self._came = b""

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._socket:
            self._socket.close()
        self._socket, self._came = None, b""
        self._open.clear()
        self._answered.clear()

    def connect(self) -> socket.socket:
        if self._socket is None:
            self._socket = socket.create_connection(self._to, timeout=self.timeout, source_address=self._from)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._socket

    def read(self, address: int, count: int = 1, values: Sequence[int] | None = None, unit: int = UNIT) -> End:
        """Reads holding registers (03H), which hold *values*: by default, each its own address."""
        known = list(range(address, address + count)) if values is None else values
        return self.ask(unit, struct.pack(">BHH", wire.READ, address, count), known)

    def write(self, address: int, value: int, unit: int = UNIT) -> End:
        """Writes one register (06H)."""
        return self.ask(unit, struct.pack(">BHH", wire.WRITE, address, value))

    def ask(self, unit: int, pdu: bytes, values: Sequence[int] = ()) -> End:
        """Sends one request and waits for its answer, until the time-out is over."""
        try:
            end = self.hear(self.send(unit, pdu, values))
        except (OSError, EOFError) as error:
            self.close()
            end = End(ERROR, f"connection: {type(error).__name__}")
        self.tally.add(end)
        return end

    def send(self, unit: int, pdu: bytes, values: Sequence[int] = ()) -> int:
        """Sends one request, and returns its transaction."""
        transaction = self._next = (self._next + 1) & 0xFFFF
        self._answered.discard(transaction)
        self._open[transaction] = _Asked(unit, pdu, values)
        self.connect().sendall(HEADER.pack(transaction, 0, len(pdu) + 1, unit) + pdu)
        return transaction

    def hear(self, awaited: int) -> End:
        """What came for *awaited*. What comes for others meanwhile is judged too, and a wrong one is tallied."""
        until = time.monotonic() + self.timeout
        while (left := until - time.monotonic()) > 0:
            transaction, end = self._judged(*self._frame(left))
            if transaction == awaited or end.kind == WRONG:
                return end
        return End(NONE)

    def listen(self, seconds: float) -> None:
        """Judges what still comes, and tallies what is wrong."""
        until = time.monotonic() + seconds
        with contextlib.suppress(OSError, EOFError):
            while self._socket and (left := until - time.monotonic()) > 0:
                _, end = self._judged(*self._frame(left))
                if end.kind == WRONG:
                    self.tally.add(end)

    def _frame(self, seconds: float) -> tuple[int, int, int, bytes]:
        """The next one: its transaction, protocol and unit, and what is in it. Transaction -1: none came."""
        until = time.monotonic() + seconds
        while True:
            if len(self._came) >= HEADER.size:
                transaction, protocol, length, unit = HEADER.unpack_from(self._came)
                size = HEADER.size - 1 + length
                if len(self._came) >= size:
                    pdu, self._came = self._came[HEADER.size : size], self._came[size:]
                    return transaction, protocol, unit, pdu
            left = until - time.monotonic()
            if left <= 0:
                return -1, 0, 0, b""
            line = self.connect()
            line.settimeout(left)
            try:
                piece = line.recv(4096)
            except TimeoutError:
                return -1, 0, 0, b""
            if not piece:
                raise EOFError("the gateway hung up")
            self._came += piece

    def _judged(self, transaction: int, protocol: int, unit: int, pdu: bytes) -> tuple[int, End]:
        if transaction == -1:
            return transaction, End(NONE)
        if transaction in self._answered:
            return transaction, End(WRONG, "a second answer to one transaction")
        asked = self._open.pop(transaction, None)
        if asked is None:
            return transaction, End(WRONG, "an answer to a transaction that nobody began")
        self._answered.add(transaction)
        if (protocol, unit) != (0, asked.unit):
            return transaction, End(WRONG, "another unit or protocol")
        return transaction, verdict(asked.pdu, asked.values, pdu)


def verdict(asked: bytes, values: Sequence[int], pdu: bytes) -> End:
    """Whether *pdu* answers *asked*; *values* are those of a read."""
    if len(pdu) == 2 and pdu[0] == asked[0] | 0x80:
        return End(ERROR, f"{pdu[1]:02X}H")
    if not pdu or pdu[0] != asked[0]:
        return End(WRONG, "another function")
    if asked[0] == wire.WRITE:
        return End(RIGHT) if pdu == asked else End(WRONG, "confirms another write")
    if pdu[1:2] != bytes([2 * len(values)]) or len(pdu) != 2 + 2 * len(values):
        return End(WRONG, "another count")
    return End(RIGHT) if pdu[2:] == wire.words(values) else End(WRONG, "other values")


def as_library(client: Client) -> Callable[[int, Sequence[int]], Outcome]:
    """Reads by *client*, in the words of the rows about libraries: values come back, or an error."""

    def read(address: int, values: Sequence[int]) -> Outcome:
        began = time.monotonic()
        end = client.read(address, len(values), values)
        took = time.monotonic() - began
        if end.kind == RIGHT:
            return Outcome(took, result=list(values))
        if end.kind == NONE:
            return Outcome(took, hung=True)
        return Outcome(took, result=end.detail) if end.kind == WRONG else Outcome(took, error=end.detail)

    return read
