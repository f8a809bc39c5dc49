"""Which units may be asked over one line: 1 to 247, and where that has a meaning those that the specification reserves.

Over Modbus TCP 255 is the gateway itself, and 0 a device by itself; but a gateway hands on what is written to 0 as a
broadcast. On a serial line 0 is the broadcast, and 248 to 254 are what some units have all the same.
"""

from __future__ import annotations

from drivebus import checks
from drivebus.advice import Advice, Text
from drivebus.errors import BadArgument

__all__ = ["EVERYBODY", "Addresses"]

_RESERVED = Advice("reserved", True, "give reserved=True to the bus")

_HIGHEST = 255
"""The highest address that a frame can carry."""


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

    @classmethod
    def of(cls, port: object, *, reserved: bool = False) -> Addresses:
        """Those of the line at *port*, as a bus takes it."""
        return cls(tcp=isinstance(port, str) and port.lower().startswith("tcp://"), reserved=reserved)

    def unit(self, value: object, *, changes: bool = False) -> int:
        """*value*, if it may be asked here; with *changes*, by what may change something in whoever hears it."""
        if type(value) is int and value in checks.UNITS:
            return value
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _HIGHEST:
            return checks.unit(value)
        why = self.why_not(value)
        if why and value:
            allowed = f"{checks.UNITS[0]} to {checks.UNITS[-1]}"
            raise BadArgument(Text(f"unit {value} is out of range; allowed is {allowed}; ", why))
        if why:
            return checks.unit(value)
        if value == 0 and changes and not self._reserved:
            raise BadArgument(
                Text(
                    "unit 0 over tcp:// may be a device by itself, and a gateway hands on what is written to it to "
                    "every unit behind it: if it is a device, ",
                    _RESERVED,
                    Advice("broadcast", None, "; or use broadcast()"),
                )
            )
        return int(value)

    def why_not(self, unit: int) -> str:
        """Why nobody is asked by *unit* here, and what to do; empty where it may at least be read."""
        if unit in checks.UNITS or (self._tcp and 0 <= unit <= _HIGHEST):
            return ""
        if not 0 <= unit <= _HIGHEST:
            return f"no frame can carry {unit}"
        if unit == 0:
            return "0 is the broadcast address, which nobody answers"
        if unit == _HIGHEST:
            return f"{_HIGHEST} is a gateway itself, over tcp:// only"
        if self._reserved:
            return ""
        return Text("the specification reserves it: ", _RESERVED, " if a unit has it anyway")


EVERYBODY = Addresses(tcp=True, reserved=True)
"""The addresses that a frame can carry, where the line is not known, or not ours."""
