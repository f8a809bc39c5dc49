"""TCP connections in a capture of a network: what each end said, in the order in which it was said.

Only as far as Modbus needs it: IP in IP, tunnels and fragments are passed over. Scapy does all of this and is under
the GPL; dpkt has had no release since 2022.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from drivebus.capture.packets import Packet
from drivebus.capture.streams import Record

__all__ = ["LINKS", "Connection", "Network", "Side"]

_IPV4, _IPV6, _VLANS = 0x0800, 0x86DD, (0x8100, 0x88A8, 0x9100)
_TCP, _UDP = 6, 17
_FIN, _SYN, _RST, _ACK = 1, 2, 4, 16
_MOST_AHEAD = 256
"""Segments that wait for one that is missing; then that is taken as lost by the capture."""

_NUMBERS = 1 << 32
_TELLING = 65_536
"""So many bytes of a connection tell what it is; other protocols would fill the memory."""

_PORTS = frozenset({502, 802})
"""At which servers of Modbus listen; of any other two the lower one is taken for the server's."""

LINKS = frozenset({0, 1, 12, 14, 101, 108, 113, 228, 229, 276})
"""Link types behind which an IP packet is found."""


@dataclass(frozen=True, slots=True)
class _Segment:
    source: tuple[str, int]
    target: tuple[str, int]
    number: int
    flags: int
    data: bytes
    missing: int


@dataclass(slots=True)
class Side:
    """What one end of a connection said.

    Attributes:
        runs: Records that follow each other; between two runs, bytes are missing.
        size: How many bytes were taken so far.
    """

    runs: list[list[Record]] = field(default_factory=lambda: [[]])
    size: int = 0
    _next: int | None = None
    _ahead: dict[int, tuple[int, float | None, bytes, int]] = field(default_factory=dict)

    def begin(self, number: int) -> None:
        """The end opens the connection; its first byte has *number*."""
        self._next = number

    def take(self, number: int, index: int, time: float | None, data: bytes, missing: int) -> None:
        """Takes *data*, whose first byte has *number*, and behind which the capture left out *missing* bytes."""
        if self._next is None:
            self._next = number
        self.size += len(data)
        self._ahead.setdefault(number, (index, time, data, missing))
        self._go_on((index, time))
        if len(self._ahead) > _MOST_AHEAD:
            self._skip()

    def finish(self) -> None:
        """Nothing more comes: what waits is taken without what it waits for."""
        while self._ahead:
            self._skip()

    def _go_on(self, now: tuple[int, float | None]) -> None:
        """Takes what follows what is known, at *now*: none of it could be read before."""
        while self._ahead:
            number = min(self._ahead, key=self._distance)
            known = -self._distance(number)
            if known < 0:
                return
            index, time, data, missing = self._ahead.pop(number)
            # What is known already comes again where an answer was lost, and to keep a connection alive.
            if known >= len(data) + missing:
                continue
            if known < len(data):
                index, time = max((index, time), now, key=lambda moment: moment[0])
                self.runs[-1].append(Record(index, time, data[known:]))
            self._next = (number + len(data) + missing) % _NUMBERS
            if missing:
                self.runs.append([])

    def _skip(self) -> None:
        """Goes on with the first of what waits."""
        self._next = number = min(self._ahead, key=self._distance)
        self.runs.append([])
        index, time, _, _ = self._ahead[number]
        self._go_on((index, time))

    def _distance(self, number: int) -> int:
        """How far *number* is behind the last byte that is known; numbers begin anew after the highest."""
        half = _NUMBERS // 2
        return (number - (self._next or 0) + half) % _NUMBERS - half


@dataclass(slots=True)
class Connection:
    """One TCP connection.

    Attributes:
        client: Address and port of who opened it, as far as the capture tells.
        server: Those of the other end.
        asked: What the client said.
        answered: What the server said.
        is_wanted: Whether what is said is kept; None while that is open.
    """

    client: tuple[str, int]
    server: tuple[str, int]
    asked: Side = field(default_factory=Side)
    answered: Side = field(default_factory=Side)
    is_wanted: bool | None = None

    @property
    def place(self) -> str:
        """The server as people write it."""
        host, port = self.server
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


class Network:
    """The TCP connections of a capture, from its packets one by one.

    Args:
        is_wanted: Is asked of each connection once, when enough was said to tell; what is not wanted is forgotten.

    Attributes:
        datagrams: How many UDP packets went to or came from a port of Modbus.
    """

    def __init__(self, is_wanted: Callable[[Connection], bool]) -> None:
        self.datagrams = 0
        self._is_wanted = is_wanted
        self._open: dict[frozenset[tuple[str, int]], Connection] = {}
        self._all: list[Connection] = []

    def take(self, index: int, packet: Packet) -> None:
        """Takes *packet*, which is at *index* in the file and whose link is one of `LINKS`."""
        try:
            found = _ip(packet.interface.link, packet.data)
            segment = None if found is None else self._segment(*found)
        except (struct.error, IndexError, ValueError):
            return
        if segment is not None:
            self._take(index, packet.time, segment)

    def connections(self) -> Iterator[Connection]:
        """The connections, each with all that was said, but those that are not wanted."""
        for connection in self._all:
            connection.asked.finish()
            connection.answered.finish()
            if connection.is_wanted is not False:
                yield connection

    def _take(self, index: int, time: float | None, segment: _Segment) -> None:
        ends = frozenset((segment.source, segment.target))
        connection = self._open.get(ends)
        opens = segment.flags & (_SYN | _ACK) == _SYN
        if connection is None or (opens and any(map(any, connection.asked.runs + connection.answered.runs))):
            is_clients = opens or (not segment.flags & _SYN and _is_servers(segment.target[1], segment.source[1]))
            client, server = (segment.source, segment.target) if is_clients else (segment.target, segment.source)
            self._open[ends] = connection = Connection(client, server)
            self._all.append(connection)
        if connection.is_wanted is False:
            return
        side = connection.asked if segment.source == connection.client else connection.answered
        if segment.flags & _SYN:
            side.begin((segment.number + 1) % _NUMBERS)
        elif segment.data or segment.missing:
            side.take(segment.number, index, time, segment.data, segment.missing)
            if connection.is_wanted is None and connection.asked.size + connection.answered.size > _TELLING:
                connection.is_wanted = self._is_wanted(connection)
                if not connection.is_wanted:
                    connection.asked, connection.answered = Side(), Side()

    def _segment(self, protocol: int, source: str, target: str, data: bytes, missing: int) -> _Segment | None:
        if protocol == _UDP:
            self.datagrams += not _PORTS.isdisjoint(struct.unpack_from(">HH", data))
            return None
        if protocol != _TCP:
            return None
        from_, to, number, _, offset, flags = struct.unpack_from(">HHIIBB", data)
        head = (offset >> 4) * 4
        if head < 20 or head > len(data):
            return None
        return _Segment((source, from_), (target, to), number, flags, data[head:], missing)


def _is_servers(one: int, other: int) -> bool:
    """Whether port *one*, and not *other*, is that of the server."""
    if (one in _PORTS) != (other in _PORTS):
        return one in _PORTS
    return one <= other


def _ip(link: int, data: bytes) -> tuple[int, str, str, bytes, int] | None:
    """The protocol, both addresses, the payload of the IP packet in *data*, and how many bytes of that are missing."""
    kind: int | None = None
    at = 0
    if link == 1:
        kind, at = struct.unpack_from(">H", data, 12)[0], 14
    elif link == 113:
        kind, at = struct.unpack_from(">H", data, 14)[0], 16
    elif link == 276:
        kind, at = struct.unpack_from(">H", data, 0)[0], 20
    elif link in (0, 108):
        at = 4
    while kind in _VLANS:
        kind, at = struct.unpack_from(">H", data, at + 2)[0], at + 4
    if kind not in (None, _IPV4, _IPV6) or at >= len(data):
        return None
    return _ipv4(data[at:]) if data[at] >> 4 == 4 else _ipv6(data[at:]) if data[at] >> 4 == 6 else None


def _ipv4(data: bytes) -> tuple[int, str, str, bytes, int] | None:
    first, _, total, _, fragment, _, protocol, _, source, target = struct.unpack_from(">BBHHHBBH4s4s", data)
    head = (first & 15) * 4
    if head < 20 or fragment & 0x3FFF:
        return None
    # Zero where the network card cuts the packet later.
    total = total or len(data)
    if total < head:
        return None
    payload = data[head:total]
    missing = total - head - len(payload)
    return (
        protocol,
        socket.inet_ntop(socket.AF_INET, source),
        socket.inet_ntop(socket.AF_INET, target),
        payload,
        missing,
    )


def _ipv6(data: bytes) -> tuple[int, str, str, bytes, int] | None:
    _, length, protocol, _, source, target = struct.unpack_from(">IHBB16s16s", data)
    payload = data[40 : 40 + length] if length else data[40:]
    missing = length - len(payload) if length else 0
    while protocol in (0, 43, 60) and len(payload) >= 8:
        protocol, payload = payload[0], payload[8 * (payload[1] + 1) :]
    return (
        protocol,
        socket.inet_ntop(socket.AF_INET6, source),
        socket.inet_ntop(socket.AF_INET6, target),
        payload,
        missing,
    )
