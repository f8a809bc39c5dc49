"""How a frame lies in a packet, by the link type of the capture.

| link type | what is in a packet | what Wireshark makes of it |
| --- | --- | --- |
| 252, upper PDU | tags, among them the name of the dissector, then the frame | Modbus RTU, without a setting |
| 250, RTAC serial | a head with the event, then bytes | Modbus RTU by "decode as" `rtacser.data,mbrtu` |
| 147 to 162, user | bytes | what its table of user link types says |

Tags of the upper PDU carry addresses and ports as if it were TCP, the unit on port 502: a write and its answer look
alike, and who sets `mbrtu.tcp.port` to 502 is told which is which. Measured with tshark 4.0.17.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass

from drivebus.capture.frame import Captured
from drivebus.capture.packets import Packet

__all__ = ["LINKS", "USB", "Said", "is_serial", "named", "packed", "said"]

LINKS: Mapping[str, int] = {"upper": 252, "rtac": 250}
"""What a capture is written as, by the name that people give."""

_USER = range(147, 163)
_DISSECTOR, _SOURCE, _TARGET, _KIND, _FROM, _TO = 12, 20, 21, 24, 25, 26
_TCP = 2
_UNIT_PORT, _MASTER_PORT = 502, 50_000
_MASTER = bytes([10, 0, 0, 254])
_TX, _RX = 1, 2
_RTAC_EVENTS = {
    5: "lost piece",
    7: "framing error",
    8: "parity error",
    9: "break",
    10: "overrun",
}
"""Events behind which bytes are missing or wrong. Source: Wireshark 4.0, `rtacser.eventtype`."""
_NAMES = {
    0: "BSD loopback",
    1: "Ethernet",
    9: "PPP",
    12: "raw IP",
    14: "raw IP",
    50: "PPP",
    101: "raw IP",
    104: "Cisco HDLC",
    105: "Wi-Fi",
    108: "OpenBSD loopback",
    113: "Linux cooked capture",
    127: "Wi-Fi",
    165: "BACnet MS/TP",
    186: "USB",
    187: "Bluetooth",
    189: "USB, by Linux usbmon",
    190: "CAN",
    192: "PPI",
    195: "IEEE 802.15.4",
    201: "Bluetooth",
    220: "USB, by Linux usbmon",
    227: "CAN",
    228: "IPv4",
    229: "IPv6",
    230: "IEEE 802.15.4",
    249: "USB, by USBPcap",
    251: "Bluetooth Low Energy",
    253: "Netlink",
    266: "USB, by macOS",
    276: "Linux cooked capture",
    288: "USB 2.0",
}
"""Link types that people have. Source: the list of link types of the tcpdump group."""
USB = frozenset({186, 189, 220, 249, 266, 288})
"""Those whose packets are what a computer says to its adapter."""
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


@dataclass(frozen=True, slots=True)
class Said:
    """What a packet of a serial line holds.

    Attributes:
        data: Bytes that went over the line; often none, in a packet that tells an event.
        outbound: Whether they were sent by the one that captured, or by a master; None where that is not told.
        event: What happened on the line, in words; empty where nothing is told.
        is_lost: Whether bytes before or behind it are missing.
    """

    data: bytes
    outbound: bool | None
    event: str = ""
    is_lost: bool = False


def is_serial(link: int) -> bool:
    """Whether packets of *link* are those of a serial line."""
    return link in LINKS.values() or link in _USER


def said(packet: Packet) -> Said:
    """What *packet* holds, whose link is one of a serial line."""
    link = packet.interface.link
    if link == LINKS["upper"]:
        data, asks = _upper(packet.data)
        return Said(data, packet.outbound if asks is None else asks, is_lost=packet.is_cut)
    if link != LINKS["rtac"]:
        return Said(packet.data, packet.outbound, is_lost=packet.is_cut)
    if len(packet.data) < _RTAC_HEAD.size:
        return Said(b"", None, is_lost=True)
    event = packet.data[8]
    told = _RTAC_EVENTS.get(event, "")
    direction = {1: True, 2: False, 3: True, 4: False}.get(event)
    return Said(packet.data[_RTAC_HEAD.size :], direction, told, packet.is_cut or bool(told))


def named(link: int) -> str:
    """*link* as people know it."""
    name = _NAMES.get(link, "")
    return f"link type {link}{f' ({name})' if name else ''}"


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
