"""Modbus RTU as the specification prints it: CRC, requests and replies.

A judge must not borrow its rules from the judged: nothing of any library is in here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

READ, WRITE, LOOP_BACK, WRITE_MANY = 0x03, 0x06, 0x08, 0x10
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, low byte first, bit by bit (Modbus over Serial Line V1.02, 6.2.2)."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register.to_bytes(2, "little")


def frame(unit: int, pdu: bytes) -> bytes:
    """*pdu* as it travels."""
    body = bytes([unit]) + pdu
    return body + crc(body)


def words(values: Sequence[int]) -> bytes:
    """Registers as they travel, high byte first."""
    return b"".join(value.to_bytes(2, "big") for value in values)


@dataclass(frozen=True)
class Request:
    """One whole request of a master."""

    unit: int
    pdu: bytes

    @property
    def function(self) -> int:
        return self.pdu[0]

    @property
    def address(self) -> int:
        """The register a read or a write begins at."""
        return int.from_bytes(self.pdu[1:3], "big")

    @property
    def count(self) -> int:
        """How many registers a read (03H) or a write (10H) is about."""
        return 1 if self.function == WRITE else int.from_bytes(self.pdu[3:5], "big")

    @property
    def values(self) -> list[int]:
        """What a write (06H, 10H) brings."""
        data = self.pdu[3:5] if self.function == WRITE else self.pdu[6:]
        return [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]

    def is_read(self, address: int) -> bool:
        return self.function == READ and self.address == address

    def is_write(self, address: int) -> bool:
        return self.function in (WRITE, WRITE_MANY) and self.address == address


def length(data: bytes | bytearray) -> int | None:
    """How long the request is that begins *data*; None while too little of it came."""
    if len(data) < 2:
        return None
    if data[1] == WRITE_MANY:
        return 9 + data[6] if len(data) > 6 else None
    return 8


def take(data: bytearray) -> Request | None:
    """Takes the first whole request out of *data*; bytes that begin none are dropped."""
    while data:
        size = length(data)
        if size is None or len(data) < size:
            return None
        whole = bytes(data[:size])
        if crc(whole[:-2]) == whole[-2:]:
            del data[:size]
            return Request(whole[0], whole[1:-2])
        del data[0]
    return None


def read_reply(unit: int, values: Sequence[int], function: int = READ) -> bytes:
    return frame(unit, bytes([function, 2 * len(values)]) + words(values))


def exception(request: Request, code: int) -> bytes:
    return frame(request.unit, bytes([request.function | 0x80, code]))
