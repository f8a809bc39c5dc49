"""Which speeds and characters are tried, and in what order, where a drive does not answer to the line's own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from drivebus.bus import Bus

__all__ = ["Settings", "candidates"]


@dataclass(frozen=True)
class Settings:
    """How characters look on the wire."""

    baudrate: int
    bytesize: int = 8
    parity: str = "E"
    stopbits: int = 1

    @classmethod
    def of(cls, bus: Bus) -> Settings:
        """Those of *bus*."""
        line = bus.format
        return cls(line.baudrate, line.bytesize, line.parity, line.stopbits)

    @property
    def format(self) -> str:
        """All but the baud rate, such as 8E1."""
        return f"{self.bytesize}{self.parity}{self.stopbits}"

    def __str__(self) -> str:
        return f"{self.baudrate} {self.format}"


_FACTORY = (Settings(19200, 8, "E", 1), Settings(9600, 8, "N", 1))
"""INVT Goodrive (P14.01 = 4, P14.02 = 1), VFD500 (P30.02 = 3, 8N1)."""

_SPEEDS = (19200, 9600, 38400, 115200, 57600, 4800)
_ALL_SPEEDS = (*_SPEEDS, 2400, 1200)
"""What the families can be set to: P14.01 of a Goodrive, P30.02 of a VFD500."""

_FORMATS = (("E", 1), ("N", 1), ("O", 1))
_ALL_FORMATS = (*_FORMATS, ("N", 2), ("E", 2), ("O", 2))


def candidates(given: Settings, full: bool) -> Iterator[Settings]:
    """Other settings than *given*, the likeliest first: those of factories, the same speed, the rest."""
    speeds, formats = (_ALL_SPEEDS, _ALL_FORMATS) if full else (_SPEEDS, _FORMATS)
    same_speed = [Settings(given.baudrate, 8, parity, stop) for parity, stop in formats]
    rest = [Settings(speed, 8, parity, stop) for parity, stop in formats for speed in speeds]
    # A dict keeps the order and each of them once.
    yield from (other for other in dict.fromkeys((*_FACTORY, *same_speed, *rest)) if other != given)
