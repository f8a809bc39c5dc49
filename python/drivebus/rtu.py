"""Modbus RTU frames without a line: encode requests, tell what they do, judge answers, take apart any frame.

Nothing here opens, sends or waits. Frames are whole: unit, PDU and CRC.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, TypeAlias

from drivebus import _native, tables
from drivebus._native import decode_answer, encode_echo, encode_read, encode_write, is_write, only_reads

__all__ = [
    "Frame",
    "decode",
    "decode_answer",
    "encode_echo",
    "encode_read",
    "encode_write",
    "framed",
    "is_frame",
    "is_write",
    "only_reads",
    "written",
]


Kind: TypeAlias = Literal[
    "read", "write", "write_many", "echo", "read_answer", "write_many_answer", "exception", "other"
]
"""What a frame is; see `Frame`."""


@dataclass(frozen=True, repr=False)
class Frame:
    """One frame of either direction, by its fields: `frame.address`, or `frame["address"]` where the name is data.

    Fields that its kind does not have are None.

    Attributes:
        kind: `"read"`, `"write"`, `"write_many"`, `"echo"` (requests, and answers that look like them),
            `"read_answer"`, `"write_many_answer"`, `"exception"` or `"other"`.
        unit: DriveView address, 0 for a broadcast.
        function: Function code; of an exception, the one that was refused.
        crc: The CRC it carries, which is right.
        table: `"input"`, `"coil"` or `"discrete"`; None where it is the holding registers.
        address: First register address.
        count: Number of registers, or of bits; of an answer with bits, all that its bytes have room for.
        value: The word of a single write; of a coil 0 or 1.
        words: The words read, or written by a 10H request; of bits 0 or 1 each.
        data: The word of an echo.
        code: Exception code.
        pdu: The PDU of a frame that is none of the above.
    """

    kind: Kind
    unit: int
    function: int
    crc: int
    table: tables.Table | None = None
    address: int | None = None
    count: int | None = None
    value: int | None = None
    words: list[int] | None = None
    data: int | None = None
    code: int | None = None
    pdu: bytes | None = None

    def __getitem__(self, name: str) -> Any:
        if name not in _FIELDS:
            raise KeyError(name)
        return getattr(self, name)

    def __repr__(self) -> str:
        shown = []
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            if field.name in ("address", "crc"):
                shown.append(f"{field.name}={value:#06x}")
            elif isinstance(value, bytes):
                shown.append(f"{field.name}={value.hex(' ')!r}")
            else:
                shown.append(f"{field.name}={value!r}")
        return f"Frame({', '.join(shown)})"


SHORTEST, LONGEST = 4, 256
"""Bytes of a frame, its address and its CRC included."""

_MASK_WRITE = 0x16

_FIELDS = frozenset(field.name for field in fields(Frame))


def decode(frame: bytes | bytearray | memoryview) -> Frame:
    """Any frame of either direction, by its fields.

    Raises:
        CrcError: The CRC does not match; the message names both.
        BadAnswer: It is too short, too long, or no frame.
    """
    return Frame(**_native.decode(frame))


def is_frame(data: bytes) -> bool:
    """Whether *data* is as long as a frame can be (4..256 bytes), and ends with its own CRC."""
    return SHORTEST <= len(data) <= LONGEST and _native.crc16(data[:-2]) == int.from_bytes(data[-2:], "little")


def framed(body: bytes) -> bytes:
    """*body*, which is a unit and a PDU, with its CRC."""
    return body + _native.crc16(body).to_bytes(2, "little")


def written(pdu: bytes) -> tuple[int, list[int]] | None:
    """The first address that the request *pdu* writes to, and the words; None if it writes none.

    Also of a 10H request whose counts are wrong, in which `decode` sees none: a drive may not look at them. Of a coil
    (05H, 0FH) the address is its place, 0x1_0000 above it, and the words are 0 or 1. Of 17H it is what is written; what
    16H leaves in a register depends on what is there: see `may_write`.
    """
    place, _, words = _native.touched(pdu) or (0, 0, None)
    return None if words is None else (place, words)


def may_write(pdu: bytes) -> list[tuple[int, list[int]]]:
    """What the request *pdu* may leave where it writes: as `written`; of 16H the least and the most."""
    if len(pdu) != 7 or pdu[0] != _MASK_WRITE:
        write = written(pdu)
        return [] if write is None else [write]
    address, kept, given = (int.from_bytes(pdu[at : at + 2], "big") for at in (1, 3, 5))
    least = given & ~kept
    return [(address, [word]) for word in sorted({least, least | kept})]
