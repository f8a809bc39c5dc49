"""One frame of a capture."""

from __future__ import annotations

from dataclasses import dataclass

from drivebus.rtu import is_frame

__all__ = ["Captured"]


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
