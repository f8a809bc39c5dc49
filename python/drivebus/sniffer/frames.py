"""What stands in a frame: where it reads or writes, and which words it carries."""

from __future__ import annotations

from drivebus import places

__all__ = ["carried", "place_of", "written_by"]

_READS = {0x01: "coil", 0x02: "discrete", 0x03: "holding", 0x04: "input"}
_COIL, _ONE, _MANY = 0x05, 0x06, 0x10


def place_of(request: bytes) -> tuple[int, int] | None:
    """The first place and how many of them *request* reads or writes; None of any other function."""
    pdu = request[1:-2]
    if pdu[0] in (*_READS, _MANY) and len(pdu) >= 5:
        return places.place(_READS.get(pdu[0]), _word(pdu, 1)), _word(pdu, 3)
    if pdu[0] in (_COIL, _ONE) and len(pdu) == 5:
        return places.place("coil" if pdu[0] == _COIL else None, _word(pdu, 1)), 1
    return None


def written_by(request: bytes) -> list[int] | None:
    """The words that *request* writes, of a coil 0 or 1; None if it writes neither."""
    pdu = request[1:-2]
    if pdu[0] == _ONE and len(pdu) == 5:
        return [_word(pdu, 3)]
    if pdu[0] == _COIL and len(pdu) == 5:
        return [int(_word(pdu, 3) != 0)]
    return _words(pdu[6:]) if pdu[0] == _MANY and len(pdu) > 6 else None


def carried(answer: bytes, request: bytes) -> list[int] | None:
    """The words, or bits, that *answer* carries, which answers the read *request*; None of any other."""
    pdu = answer[1:-2]
    table = _READS.get(pdu[0])
    if table is None or len(pdu) <= 2:
        return None
    if table not in places.BITS:
        return _words(pdu[2:])
    bits = int.from_bytes(pdu[2:], "little")
    return [bits >> at & 1 for at in range(min(_word(request, 4), 8 * len(pdu[2:])))]


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "big")


def _words(data: bytes) -> list[int]:
    return [_word(data, at) for at in range(0, len(data) - 1, 2)]
