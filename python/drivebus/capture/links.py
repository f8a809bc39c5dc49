"""How a frame lies in a packet, by the link type of the capture.

| link type | what is in a packet | what Wireshark makes of it |
| --- | --- | --- |
| 252, upper PDU | tags, among them the name of the dissector, then the frame | Modbus RTU, without a setting |
| 250, RTAC serial | a head with the kind of event, then the frame | Modbus RTU by "decode as" `rtacser.data,mbrtu` |
| 147 to 162, user | the frame | what its table of user link types says |

Tags of the upper PDU carry addresses and ports as if it were TCP, the unit on port 502: a write and its answer look
alike, and who sets `mbrtu.tcp.port` to 502 is told which is which. Measured with tshark 4.0.17.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping

from drivebus.capture.frame import Captured
from drivebus.capture.pcapng import Packet
from drivebus.errors import NotAllowed

__all__ = ["LINKS", "captured", "packed"]

LINKS: Mapping[str, int] = {"upper": 252, "rtac": 250}
"""What a capture is written as, by the name that people give."""

_USER = range(147, 163)
_DISSECTOR, _SOURCE, _TARGET, _KIND, _FROM, _TO = 12, 20, 21, 24, 25, 26
_TCP = 2
_UNIT_PORT, _MASTER_PORT = 502, 50_000
_MASTER = bytes([10, 0, 0, 254])
_TX, _RX = 1, 2
_RTAC_HEAD = struct.Struct(">IIBBH")


def packed(frame: Captured, link: str, is_frame: bool) -> bytes:
    """*frame* as a packet of *link*; *is_frame* says whether it is one, and not noise."""
    if link == "rtac":
        return _rtac(frame) + frame.data
    tags = _tag(_DISSECTOR, b"mbrtu" if is_frame else b"data")
    if frame.asks is not None and is_frame:
        unit = bytes([10, 0, 0, frame.data[0]])
        ends = [(_MASTER, _MASTER_PORT), (unit, _UNIT_PORT)]
        (source, port), (target, to) = ends if frame.asks else reversed(ends)
        tags += _tag(_SOURCE, source) + _tag(_TARGET, target) + _tag(_KIND, struct.pack(">I", _TCP))
        tags += _tag(_FROM, struct.pack(">I", port)) + _tag(_TO, struct.pack(">I", to))
    return tags + _tag(0, b"") + frame.data


def captured(packet: Packet, name: str) -> Captured:
    """The frame in *packet*; *name* is for messages.

    Raises:
        NotAllowed: Its link type is none of a serial line.
    """
    if packet.link == LINKS["upper"]:
        data, asks = _upper(packet.data)
        return Captured(packet.time, data, packet.outbound if asks is None else asks)
    if packet.link == LINKS["rtac"]:
        event = packet.data[8] if len(packet.data) >= _RTAC_HEAD.size else 0
        return Captured(packet.time, packet.data[_RTAC_HEAD.size :], {_TX: True, _RX: False}.get(event))
    if packet.link in _USER:
        return Captured(packet.time, packet.data, packet.outbound)
    raise NotAllowed(
        f"{name} is a capture of link type {packet.link}, which is not a serial line; captures of Modbus RTU have 252 "
        "(upper PDU), 250 (RTAC serial) or 147 to 162 (user)"
    )


def _upper(data: bytes) -> tuple[bytes, bool | None]:
    """The frame behind the tags of *data*, and whether they say that a master sent it."""
    at, asks = 0, None
    while at + 4 <= len(data):
        tag, length = struct.unpack_from(">HH", data, at)
        value = data[at + 4 : at + 4 + length]
        at += 4 + length
        if tag == 0:
            break
        if tag in (_FROM, _TO) and int.from_bytes(value, "big") == _UNIT_PORT:
            asks = tag == _TO
    return data[at:], asks


def _rtac(frame: Captured) -> bytes:
    seconds, part = divmod(round((frame.time or 0.0) * 1e6), 1_000_000)
    event = {True: _TX, False: _RX, None: _RX}[frame.asks]
    return _RTAC_HEAD.pack(seconds & 0xFFFF_FFFF, part, event, 0, 0)


def _tag(tag: int, value: bytes) -> bytes:
    padded = value + bytes(-len(value) % 4)
    return struct.pack(">HH", tag, len(padded)) + padded
