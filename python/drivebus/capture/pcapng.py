"""The blocks of a pcapng file, as far as captures of a serial line need them.

Source: draft-ietf-opsawg-pcapng. Three kinds of blocks are written; what else stands in a file is passed over. The
library for this has had no release since 2022, and brings a schema language for all block types.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from drivebus.errors import NotAllowed

__all__ = ["MAGIC", "Packet", "description", "interface", "packet", "packets", "section"]

MAGIC = b"\x0a\x0d\x0d\x0a"
"""How every file begins, whichever byte order it has."""

_SECTION, _INTERFACE, _SIMPLE, _ENHANCED = 0x0A0D0D0A, 1, 3, 6
_BYTE_ORDER = 0x1A2B3C4D
_END, _NAME, _DESCRIPTION, _RESOLUTION, _FLAGS, _APPLICATION = 0, 2, 3, 9, 2, 4
_NANOSECONDS = b"\x09"
_INBOUND, _OUTBOUND = 1, 2
_LARGEST = 16 * 1024 * 1024
"""A longer block is no block of a capture that this program could have a use for."""


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet of a file.

    Attributes:
        link: Its link type.
        time: Unix time in seconds; None where its block tells none.
        outbound: Whether it was sent by the one that captured; None where that is not told.
        data: What was captured.
    """

    link: int
    time: float | None
    outbound: bool | None
    data: bytes


def section(application: str) -> bytes:
    """The block with which a file begins."""
    body = struct.pack("<IHHq", _BYTE_ORDER, 1, 0, -1)
    return _block(_SECTION, body + _options([(_APPLICATION, application.encode())]))


def interface(link: int, name: str, description: str) -> bytes:
    """The block of the line on which the packets were; times are in nanoseconds."""
    options = [(_NAME, name.encode()), (_DESCRIPTION, description.encode()), (_RESOLUTION, _NANOSECONDS)]
    return _block(_INTERFACE, struct.pack("<HHI", link, 0, 0) + _options(options))


def packet(time: float, data: bytes, outbound: bool | None) -> bytes:
    """The block of a packet on the first interface, at *time* in Unix seconds."""
    moment = round(time * 1e9)
    head = struct.pack("<IIIII", 0, moment >> 32, moment & 0xFFFF_FFFF, len(data), len(data))
    flags = [] if outbound is None else [(_FLAGS, struct.pack("<I", _OUTBOUND if outbound else _INBOUND))]
    return _block(_ENHANCED, head + _padded(data) + (_options(flags) if flags else b""))


def description(stream: BinaryIO, name: str) -> str | None:
    """What the file says of the line on which its packets were; None where it does not.

    Raises:
        NotAllowed: It is not such a file, or breaks off before.
    """
    order, head = "<", stream.read(8)
    while head:
        if int.from_bytes(head[:4], "little") == _SECTION:
            head += stream.read(4)
            order = _order(head[8:], name)
        body, _ = _rest(stream, head, order, name, 0)
        if struct.unpack(f"{order}I", head[:4])[0] == _INTERFACE:
            told = next((value for code, value in _listed(body[8:], order) if code == _DESCRIPTION), None)
            return None if told is None else told.decode(errors="replace")
        head = stream.read(8)
    return None


def packets(stream: BinaryIO, name: str) -> Iterator[Packet]:
    """The packets of *stream*; *name* is for messages.

    Raises:
        NotAllowed: It is not such a file, or breaks off; what came before was yielded.
    """
    order, interfaces, count = "<", list[tuple[int, float]](), 0
    while True:
        head = stream.read(8)
        if not head:
            return
        kind = int.from_bytes(head[:4], "little")
        if kind == _SECTION:
            head += stream.read(4)
            order, interfaces = _order(head[8:], name), []
        body, more = _rest(stream, head, order, name, count)
        kind = struct.unpack(f"{order}I", head[:4])[0]
        try:
            if kind == _INTERFACE:
                interfaces.append((struct.unpack_from(f"{order}H", body)[0], _tick(body[8:], order)))
            elif kind in (_ENHANCED, _SIMPLE):
                yield _packet(kind, body, order, interfaces)
                count += 1
        except (struct.error, IndexError, ValueError) as error:
            raise NotAllowed(f"{name} has a block that is not whole behind its packet {count}: {error}") from None
        if not more:
            return


def _order(magic: bytes, name: str) -> str:
    for order in "<>":
        if len(magic) == 4 and struct.unpack(f"{order}I", magic)[0] == _BYTE_ORDER:
            return order
    raise NotAllowed(f"{name} begins as a pcapng file and has no byte order; it is damaged")


def _rest(stream: BinaryIO, head: bytes, order: str, name: str, count: int) -> tuple[bytes, bool]:
    """The body of the block that begins with *head*, without its length at the end; and whether more may follow."""
    length = struct.unpack(f"{order}I", head[4:8])[0] if len(head) >= 8 else 0
    broken = NotAllowed(f"{name} breaks off behind its packet {count}: it is not a whole pcapng file")
    if not 12 <= length <= _LARGEST or length % 4:
        raise broken
    rest = stream.read(length - len(head))
    if len(rest) != length - len(head):
        raise broken
    return head[8:] + rest[:-4], True


def _tick(options: bytes, order: str) -> float:
    """Seconds of one tick of the time stamps: a microsecond, unless an option says otherwise."""
    for code, value in _listed(options, order):
        if code == _RESOLUTION and value:
            return 2.0 ** -(value[0] & 0x7F) if value[0] & 0x80 else 10.0 ** -value[0]
    return 1e-6


def _packet(kind: int, body: bytes, order: str, interfaces: list[tuple[int, float]]) -> Packet:
    if kind == _SIMPLE:
        return Packet(interfaces[0][0], None, None, body[4 : 4 + struct.unpack_from(f"{order}I", body)[0]])
    index, high, low, length, _ = struct.unpack_from(f"{order}IIIII", body)
    link, tick = interfaces[index]
    data = body[20 : 20 + length]
    if len(data) != length:
        raise ValueError(f"a packet of {length} bytes has {len(data)}")
    flags = next((value for code, value in _listed(body[20 + length + -length % 4 :], order) if code == _FLAGS), b"")
    direction = struct.unpack(f"{order}I", flags)[0] & 3 if len(flags) == 4 else 0
    moment = high << 32 | low
    # The whole seconds apart: a float has no room for both.
    ticks = round(1 / tick)
    time = moment // ticks + moment % ticks * tick
    return Packet(link, time, {_INBOUND: False, _OUTBOUND: True}.get(direction), data)


def _listed(options: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(options):
        code, length = struct.unpack_from(f"{order}HH", options, at)
        if code == _END:
            return
        yield code, options[at + 4 : at + 4 + length]
        at += 4 + length + -length % 4


def _options(options: list[tuple[int, bytes]]) -> bytes:
    listed = b"".join(struct.pack("<HH", code, len(value)) + _padded(value) for code, value in options)
    return listed + struct.pack("<HH", _END, 0)


def _block(kind: int, body: bytes) -> bytes:
    length = len(body) + 12
    return struct.pack("<II", kind, length) + body + struct.pack("<I", length)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)
