"""Which units may be asked over one line: 1 to 247, and where that has a meaning those that the specification reserves.

Over Modbus TCP 255 is the gateway itself, and 0 a device by itself; but a gateway hands on what is written to 0 as a
broadcast. On a serial line 0 is the broadcast, and 248 to 254 are what some units have all the same.
"""

from __future__ import annotations

from drivebus import checks
from drivebus.errors import NotAllowed

__all__ = ["Addresses", "only_reads"]

_READS = frozenset({0x01, 0x02, 0x03, 0x04, 0x07, 0x11, 0x2B})
"""Functions that change nothing in whoever hears them."""


class Addresses:
    """The units of one line.

    Args:
        tcp: Whether it is Modbus TCP.
        reserved: Whether somebody asked by name for what is not asked otherwise.
    """

    __slots__ = ("_reserved", "_tcp")

    def __init__(self, *, tcp: bool = False, reserved: bool = False) -> None:
        self._tcp = tcp
        self._reserved = reserved

    def unit(self, value: object, *, changes: bool = False) -> int:
        """*value*, if it may be asked here; with *changes*, by what may change something in whoever hears it."""
        if type(value) is int and 0 < value <= 247:
            return value
        if isinstance(value, bool) or not isinstance(value, int) or not (value == 0 or 247 < value <= 255):
            return checks.unit(value)
        if self._tcp:
            if value == 0 and changes and not self._reserved:
                raise NotAllowed(
                    "unit 0 over tcp:// may be a device by itself, and a gateway hands on what is written to it to "
                    "every unit behind it: if it is a device, give reserved=True to the bus; or use broadcast()"
                )
            return int(value)
        if value == 0:
            return checks.unit(value)
        if value == 255:
            raise NotAllowed("unit 255 is out of range; allowed is 1 to 247; 255 is a gateway itself, over tcp:// only")
        if not self._reserved:
            raise NotAllowed(
                f"unit {value} is out of range; allowed is 1 to 247; the specification reserves it: give reserved=True "
                "to the bus if a unit has it all the same"
            )
        return int(value)


def only_reads(pdu: bytes) -> bool:
    """Whether *pdu* changes nothing in whoever hears it."""
    return pdu[:1] != b"" and pdu[0] in _READS
