"""What stands in a frame: where it reads or writes, and which words it carries."""

from __future__ import annotations

from drivebus import _native, tables

__all__ = ["carried", "place_of", "written_by"]

_READS = range(0x01, 0x05)


def place_of(request: bytes) -> tuple[int, int] | None:
    """The first place and how many of them *request* reads or writes; None of any other function."""
    touched = _native.touched(request[1:-2])
    return touched and touched[:2]


def written_by(request: bytes) -> list[int] | None:
    """The words that *request* writes, of a coil 0 or 1; None if it writes neither."""
    touched = _native.touched(request[1:-2])
    return touched and touched[2]


def carried(answer: bytes, request: bytes) -> list[int] | None:
    """The words, or bits, that *answer* carries, which answers the read *request*; None of any other."""
    asked, data = place_of(request), answer[3:-2]
    if asked is None or answer[1] != request[1] or answer[1] not in _READS or not data:
        return None
    place, count = asked
    if tables.split(place)[0] not in tables.BITS:
        return [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data) - 1, 2)]
    bits = int.from_bytes(data, "little")
    return [bits >> at & 1 for at in range(min(count, 8 * len(data)))]
