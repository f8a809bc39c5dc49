"""What stands in a frame: where it reads or writes, and which words it carries."""

from __future__ import annotations

__all__ = ["carried", "place_of", "written_by"]

_READS = (0x03, 0x04)
_ONE, _MANY = 0x06, 0x10


def place_of(request: bytes) -> tuple[int, int] | None:
    """The first register and how many of them *request* reads or writes; None of any other function."""
    pdu = request[1:-2]
    if pdu[0] in (*_READS, _MANY) and len(pdu) >= 5:
        return _word(pdu, 1), _word(pdu, 3)
    if pdu[0] == _ONE and len(pdu) == 5:
        return _word(pdu, 1), 1
    return None


def written_by(request: bytes) -> list[int] | None:
    """The words that *request* writes; None if it writes no registers."""
    pdu = request[1:-2]
    if pdu[0] == _ONE and len(pdu) == 5:
        return [_word(pdu, 3)]
    return _words(pdu[6:]) if pdu[0] == _MANY and len(pdu) > 6 else None


def carried(answer: bytes) -> list[int] | None:
    """The words that *answer*, the answer to a read of registers, carries; None of any other."""
    pdu = answer[1:-2]
    return _words(pdu[2:]) if pdu[0] in _READS and len(pdu) > 2 else None


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "big")


def _words(data: bytes) -> list[int]:
    return [_word(data, at) for at in range(0, len(data) - 1, 2)]
