"""Capture files made byte by byte, as the formats' descriptions say, with nothing of what reads them."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterable

__all__ = ["block", "crc", "ethernet", "framed", "interface", "packet", "pcap", "rtac", "section", "tcp"]


def crc(body: bytes) -> bytes:
    """The CRC of *body*, bit by bit, as the specification has it."""
    value = 0xFFFF
    for byte in body:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


def framed(body: str) -> bytes:
    data = bytes.fromhex(body)
    return data + crc(data)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def block(kind: int, body: bytes, order: str = "<") -> bytes:
    length = struct.pack(f"{order}I", len(body) + 12)
    return struct.pack(f"{order}I", kind) + length + body + length


def section(order: str = "<") -> bytes:
    return block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def _option(code: int, value: bytes, order: str) -> bytes:
    return struct.pack(f"{order}HH", code, len(value)) + _padded(value)


def interface(
    link: int,
    order: str = "<",
    *,
    name: str = "",
    description: str = "",
    resolution: int | None = None,
    offset: int = 0,
    longest: int = 0,
) -> bytes:
    options = _option(3, description.encode(), order) if description else b""
    if name:
        options += _option(2, name.encode(), order)
    if resolution is not None:
        options += _option(9, bytes([resolution]), order)
    if offset:
        options += _option(14, struct.pack(f"{order}q", offset), order)
    end = struct.pack(f"{order}HH", 0, 0) if options else b""
    return block(1, struct.pack(f"{order}HHI", link, 0, longest) + options + end, order)


def packet(
    stamp: int, data: bytes, order: str = "<", *, on: int = 0, outbound: bool | None = None, whole: int | None = None
) -> bytes:
    """An enhanced packet block, at *stamp* in ticks of its interface."""
    length = len(data) if whole is None else whole
    head = struct.pack(f"{order}IIIII", on, stamp >> 32, stamp & 0xFFFF_FFFF, len(data), length)
    flags = b""
    if outbound is not None:
        flags = _option(2, struct.pack(f"{order}I", 2 if outbound else 1), order) + struct.pack(f"{order}HH", 0, 0)
    return block(6, head + _padded(data) + flags, order)


def pcap(
    link: int, packets: Iterable[tuple[float, bytes]], order: str = "<", *, nanoseconds: bool = False, longest: int = 0
) -> bytes:
    magic, parts = (0xA1B23C4D, 10**9) if nanoseconds else (0xA1B2C3D4, 10**6)
    made = struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, longest or 65535, link)
    for time, data in packets:
        kept = data[:longest] if longest else data
        seconds = int(time)
        made += struct.pack(f"{order}IIII", seconds, round((time - seconds) * parts), len(kept), len(data)) + kept
    return made


def rtac(event: int, data: bytes = b"", stamp: tuple[int, int] = (0, 0)) -> bytes:
    """A packet of link type 250: its head is in network order."""
    return struct.pack(">IIBBH", *stamp, event, 0, 0) + data


def tcp(
    source: tuple[str, int],
    target: tuple[str, int],
    number: int,
    data: bytes,
    flags: int = 0x18,
) -> bytes:
    """An IP packet with a segment; its checksums are left zero, as network cards leave them."""
    segment = struct.pack(">HHIIBBHHH", source[1], target[1], number % 2**32, 0, 0x50, flags, 1024, 0, 0) + data
    if ":" in source[0]:
        ends = socket.inet_pton(socket.AF_INET6, source[0]) + socket.inet_pton(socket.AF_INET6, target[0])
        return struct.pack(">IHBB", 6 << 28, len(segment), 6, 64) + ends + segment
    ends = socket.inet_aton(source[0]) + socket.inet_aton(target[0])
    return struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(segment), 0, 0, 64, 6, 0) + ends + segment


def ethernet(packet: bytes, *vlans: int) -> bytes:
    """A frame with *packet*, padded to the shortest that Ethernet has."""
    tags = b"".join(struct.pack(">HH", 0x8100, vlan) for vlan in vlans)
    kind = struct.pack(">H", 0x86DD if packet[0] >> 4 == 6 else 0x0800)
    return (bytes(6) + bytes([2, 0, 0, 0, 0, 1]) + tags + kind + packet).ljust(60, b"\0")
