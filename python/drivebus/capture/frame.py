"""One frame of a capture, whether bytes are one, and what makes them one."""

from __future__ import annotations

from dataclasses import dataclass

from drivebus._native import crc16

__all__ = ["LONGEST", "SHORTEST", "Captured", "framed", "is_frame"]

SHORTEST, LONGEST = 4, 256
"""Bytes of a frame, its address and its CRC included."""


@dataclass(frozen=True, slots=True)
class Captured:
    """A frame that went over a line, or bytes that are not one.

    Attributes:
        time: Unix time in seconds at which it had come or had left; None where the capture does not tell.
        data: All of it, with address and CRC.
        asks: Whether a master sent it; None where the capture does not tell.
        line: Which of the lines in the capture it went over, by the name of its interface or of a server's port; empty
            where there is only one.
        connection: Which of the connections to that server; a request is answered on its own.
        at_once: Whether its characters took no time, as over a network.
    """

    time: float | None
    data: bytes
    asks: bool | None = None
    line: str = ""
    connection: int = 0
    at_once: bool = False

    @property
    def is_frame(self) -> bool:
        """Whether it is one: its CRC is right."""
        return is_frame(self.data)


def is_frame(data: bytes) -> bool:
    """Whether *data* is as long as a frame can be, and ends with its own CRC."""
    return SHORTEST <= len(data) <= LONGEST and crc16(data[:-2]) == int.from_bytes(data[-2:], "little")


def framed(body: bytes) -> bytes:
    """*body*, which is a unit and a PDU, with its CRC."""
    return body + crc16(body).to_bytes(2, "little")
