"""The older pcap format: one interface, and packets one behind the other.

Source: draft-ietf-opsawg-pcap. Both byte orders; stamps in microseconds or nanoseconds, as the first bytes tell.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import BinaryIO

from drivebus.capture.packets import LARGEST, Interface, Packet, moment
from drivebus.errors import BadArgument

__all__ = ["MAGICS", "packets"]

MAGICS = {
    b"\xa1\xb2\xc3\xd4": (">", 10**6),
    b"\xd4\xc3\xb2\xa1": ("<", 10**6),
    b"\xa1\xb2\x3c\x4d": (">", 10**9),
    b"\x4d\x3c\xb2\xa1": ("<", 10**9),
}
"""How a file begins: its byte order, and the ticks of its stamps in a second."""

_LINK = 0x0FFF_FFFF
"""What is above these bits tells of checksums behind the packets, not of the link."""


def packets(stream: BinaryIO, name: str) -> Iterator[Packet]:
    """The packets of *stream*; *name* is for messages.

    Raises:
        NotAllowed: It is not such a file, or breaks off; what came before was yielded.
    """
    head = stream.read(24)
    if head[:4] not in MAGICS or len(head) < 24:
        raise BadArgument(f"{name} breaks off in its head: it is not a whole pcap file")
    order, per_second = MAGICS[head[:4]]
    interface = Interface(0, struct.unpack(f"{order}I", head[20:])[0] & _LINK)
    count = 0
    while head := stream.read(16):
        length = LARGEST + 1
        if len(head) == 16:
            seconds, part, length, whole = struct.unpack(f"{order}IIII", head)
        data = stream.read(length) if length <= LARGEST else b""
        if len(data) < length:
            raise BadArgument(f"{name} breaks off behind its packet {count}: it is not a whole pcap file")
        time = moment(seconds * per_second + part, per_second) if part < per_second else None
        yield Packet(interface, time, None, data, length < whole)
        count += 1
