"""What the readers of capture files have in common: packets, and the interfaces on which they were."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["LARGEST", "Interface", "Packet", "moment"]

LARGEST = 16 * 1024 * 1024
"""A longer packet or block is none of a capture that this program could have a use for."""

_LATEST = 253_402_000_000
"""Unix time short of the year 10000: no capture is of later."""


@dataclass(frozen=True, slots=True)
class Interface:
    """What packets were captured on. One that is the same in another section of the file goes on there.

    Attributes:
        number: Its number in its section; the first is 0.
        link: Its link type.
        name: What the file calls it; empty where it does not.
    """

    number: int
    link: int
    name: str = ""


@dataclass(frozen=True, slots=True)
class Packet:
    """One packet of a file.

    Attributes:
        interface: Where it was captured.
        time: Unix time in seconds; None where the file tells none, or none that can be.
        outbound: Whether it was sent by the one that captured; None where that is not told.
        data: What was captured.
        is_cut: Whether it was longer than what was captured.
    """

    interface: Interface
    time: float | None
    outbound: bool | None
    data: bytes
    is_cut: bool = False


def moment(ticks: int, per_second: int, offset: int = 0) -> float | None:
    """The Unix time of *ticks*, *per_second* of them, and *offset* seconds; None where that cannot be one."""
    # The whole seconds apart: a float has no room for both.
    seconds = ticks // per_second + offset
    return seconds + ticks % per_second / per_second if 0 <= seconds < _LATEST else None
