"""The blocks of a pcapng file, as far as captures of a serial line need them.

Source: draft-ietf-opsawg-pcapng. Three kinds of blocks are written; what else stands in a file is passed over. The
library for this has had no release since 2022, and brings a schema language for all block types.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

from drivebus.capture.packets import LARGEST, Interface, Packet, moment
from drivebus.errors import BadArgument

__all__ = ["MAGIC", "descriptions", "interface", "packet", "packets", "section"]

MAGIC = b"\x0a\x0d\x0d\x0a"
"""How every file begins, whichever byte order it has."""

_SECTION, _INTERFACE, _OLD, _SIMPLE, _ENHANCED = 0x0A0D0D0A, 1, 2, 3, 6
_PACKETS = (_ENHANCED, _SIMPLE, _OLD)
_BYTE_ORDER = 0x1A2B3C4D
_END, _NAME, _DESCRIPTION, _RESOLUTION, _OFFSET, _FLAGS, _APPLICATION = 0, 2, 3, 9, 14, 2, 4
_NANOSECONDS = b"\x09"
_INBOUND, _OUTBOUND = 1, 2
_MOST_PARTS = 10**18
"""A stamp counts no smaller parts of a second than this."""

_Line = tuple[Interface, int, int, int]
"""An interface, the ticks of its stamps in a second, the seconds to add, and the longest packet kept (0: any)."""


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


def descriptions(stream: BinaryIO, name: str) -> Iterator[str]:
    """What the file says of the lines on which its packets were, as far as it does before the first of them.

    Raises:
        NotAllowed: It is not such a file, or breaks off before.
    """
    order = "<"
    while head := stream.read(8):
        if int.from_bytes(head[:4], "little") == _SECTION:
            head += stream.read(4)
            order = _order(head[8:], name)
        kind = int.from_bytes(head[:4], "little" if order == "<" else "big")
        if kind in _PACKETS:
            return
        body = _rest(stream, head, order, name, 0)
        if kind == _INTERFACE:
            yield from (
                value.decode(errors="replace") for code, value in _listed(body[8:], order) if code == _DESCRIPTION
            )


def packets(stream: BinaryIO, name: str) -> Iterator[Packet]:
    """The packets of *stream*; *name* is for messages.

    Raises:
        NotAllowed: It is not such a file, or breaks off; what came before was yielded.
    """
    order, lines, count = "<", list[_Line](), 0
    while True:
        head = stream.read(8)
        if not head:
            return
        kind = int.from_bytes(head[:4], "little")
        if kind == _SECTION:
            head += stream.read(4)
            order, lines = _order(head[8:], name), []
        body = _rest(stream, head, order, name, count)
        kind = struct.unpack(f"{order}I", head[:4])[0]
        try:
            if kind == _INTERFACE:
                lines.append(_line(body, order, len(lines)))
            elif kind in _PACKETS:
                yield _packet(kind, body, order, lines)
                count += 1
        except (struct.error, ValueError) as error:
            raise BadArgument(f"{name} has a block that is not whole behind its packet {count}: {error}") from None


def _order(magic: bytes, name: str) -> str:
    for order in "<>":
        if len(magic) == 4 and struct.unpack(f"{order}I", magic)[0] == _BYTE_ORDER:
            return order
    raise BadArgument(f"{name} begins as a pcapng file and has no byte order; it is damaged")


def _rest(stream: BinaryIO, head: bytes, order: str, name: str, count: int) -> bytes:
    """The body of the block that begins with *head*, without its length at the end."""
    length = struct.unpack(f"{order}I", head[4:8])[0] if len(head) >= 8 else 0
    if 12 <= length <= LARGEST and length % 4 == 0:
        rest = stream.read(length - len(head))
        if len(rest) == length - len(head) and rest[-4:] == head[4:8]:
            return head[8:] + rest[:-4]
    raise BadArgument(f"{name} breaks off behind its packet {count}: it is not a whole pcapng file")


def _line(body: bytes, order: str, number: int) -> _Line:
    """The interface whose block has *body*: stamps are in microseconds, unless an option says otherwise."""
    link, _, longest = struct.unpack_from(f"{order}HHI", body)
    name, per_second, offset = "", 10**6, 0
    for code, value in _listed(body[8:], order):
        if code == _NAME:
            name = "".join(letter for letter in value.decode(errors="replace") if letter.isprintable())
        elif code == _RESOLUTION and value:
            per_second = 2 ** (value[0] & 0x7F) if value[0] & 0x80 else 10 ** value[0]
        elif code == _OFFSET and len(value) == 8:
            offset = struct.unpack(f"{order}q", value)[0]
    if per_second > _MOST_PARTS:
        raise ValueError(f"no stamp counts parts of a second as small as 1/{per_second:.3g}")
    return Interface(number, link, name), per_second, offset, longest


def _packet(kind: int, body: bytes, order: str, lines: list[_Line]) -> Packet:
    if kind == _SIMPLE:
        interface, _, _, longest = _described(lines, 0)
        (whole,) = struct.unpack_from(f"{order}I", body)
        length = min(whole, longest) if longest else whole
        return Packet(interface, None, None, _whole(body[4:], length), length < whole)
    index, high, low, length, whole = struct.unpack_from(f"{order}IIIII", body)
    if kind == _OLD:
        # Its number has two bytes; the packets that were dropped are counted in the other two.
        (index,) = struct.unpack_from(f"{order}H", body)
    interface, per_second, offset, _ = _described(lines, index)
    data = _whole(body[20:], length)
    flags = next((value for code, value in _listed(body[20 + length + -length % 4 :], order) if code == _FLAGS), b"")
    direction = struct.unpack(f"{order}I", flags)[0] & 3 if len(flags) == 4 else 0
    time = moment(high << 32 | low, per_second, offset)
    return Packet(interface, time, {_INBOUND: False, _OUTBOUND: True}.get(direction), data, length < whole)


def _described(lines: list[_Line], index: int) -> _Line:
    if index >= len(lines):
        raise ValueError(f"its interface {index} is not described")
    return lines[index]


def _whole(data: bytes, length: int) -> bytes:
    if len(data) < length:
        raise ValueError(f"a packet of {length} bytes has {len(data)}")
    return data[:length]


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
