"""How characters look on a wire: what a search tries, and which ports it can be changed on."""

from __future__ import annotations

import os
from dataclasses import dataclass

from drivebus._native import SerialFormat
from drivebus.line.settings import BusFace

__all__ = ["Settings", "can_be_changed"]

_SET_ELSEWHERE = ("socket://", "tcp://", "sim://")
"""Ports whose characters are somebody else's business: a serial server's, a gateway's, a simulation's."""


@dataclass(frozen=True)
class Settings:
    """How characters look on the wire.

    Attributes:
        baudrate: Bits per second.
        bytesize: Data bits, 7 or 8.
        parity: `"N"`, `"E"` or `"O"`.
        stopbits: 1 or 2.
    """

    baudrate: int
    bytesize: int = 8
    parity: str = "E"
    stopbits: int = 1

    @classmethod
    def of(cls, bus: BusFace) -> Settings:
        """Those of *bus*."""
        line = bus.format
        return cls(line.baudrate, line.bytesize, line.parity, line.stopbits)

    @property
    def format(self) -> str:
        """All but the baud rate, such as 8E1."""
        return f"{self.bytesize}{self.parity}{self.stopbits}"

    @property
    def timing(self) -> SerialFormat:
        """How long a character takes so, and the silence between frames.

        Raises:
            NotAllowed: There are no such characters.
        """
        return SerialFormat(self.baudrate, self.parity, self.stopbits, self.bytesize)

    def __str__(self) -> str:
        return f"{self.baudrate} {self.format}"


def can_be_changed(port: object) -> bool:
    """Whether *port* can be opened with other settings: not behind a server, nor what is open already."""
    if isinstance(port, str):
        return not port.startswith(_SET_ELSEWHERE)
    return isinstance(port, os.PathLike)
