"""A frame whose CRC is right and whose inside is not: what is wrong with it, in words."""

from __future__ import annotations

from drivebus.line.frames import is_frame

__all__ = ["wrong_inside"]

_RIGHT = "; the CRC is right"

_FIXED = {0x05: "write of a coil", 0x06: "write", 0x08: "echo"}
"""Functions whose request and answer have five bytes each."""


def wrong_inside(frame: bytes, asked: bytes | None = None) -> str | None:
    """What is wrong inside *frame*, which came to the request *asked*; None if it is no frame, or nothing is wrong."""
    if not is_frame(frame):
        return None
    function, data = frame[1], frame[2:-2]
    wrong: str | None = None
    if function in (0x0F, 0x10):
        wrong = _of_write(function, data)
    elif function in (0x01, 0x02, 0x03, 0x04):
        wrong = _of_read(function, data, None if asked is None or asked[:2] != frame[:2] else asked)
    elif function in _FIXED and len(data) != 4 and not (function == 0x08 and data[:2] != b"\0\0"):
        wrong = f"{_FIXED[function]} with {_bytes(len(data))} where 4 belong"
    elif function & 0x80 and len(data) != 1:
        wrong = f"refusal of function {function & 0x7F:02X}H with {_bytes(len(data))} where 1 belongs"
    return None if wrong is None else wrong + _RIGHT


def _of_write(function: int, data: bytes) -> str | None:
    """What is wrong with the request or answer that *data* is, behind 0FH or 10H."""
    if len(data) == 4:
        return None  # an answer
    if len(data) < 5:
        return f"write of several with {_bytes(len(data))} where 4 are the least"
    count, announced, came = int.from_bytes(data[2:4], "big"), data[4], len(data) - 5
    what, needs = (_words(count), 2 * count) if function == 0x10 else (f"{count} coils", (count + 7) // 8)
    if announced == needs == came and count:
        return None
    of = f"write of {what}"
    if announced == came == 0:
        return of
    if came != announced:
        return f"{of} with {_bytes(came)} of data where {announced} {'is' if announced == 1 else 'are'} announced"
    return f"{of} with {_bytes(came)} of data where {needs} belong"


def _of_read(function: int, data: bytes, asked: bytes | None) -> str | None:
    """What is wrong with the answer that *data* is, behind a function that reads; a request has four bytes."""
    if not data:
        return "answer without a byte count"
    most = 2000 if function < 0x03 else 125
    if len(data) == 4 and 1 <= int.from_bytes(data[2:], "big") <= most and (asked is None or data[0] != 3):
        return None  # a request
    announced, came = data[0], len(data) - 1
    if announced != came:
        return f"answers with {_bytes(came)} of data where {announced} {'is' if announced == 1 else 'are'} announced"
    bits = function < 0x03
    if not bits and came % 2:
        return f"answers with {_bytes(came)} of data, which are no whole words"
    wanted = None if asked is None or len(asked) != 8 else int.from_bytes(asked[4:6], "big")
    has = f"{came} bytes of bits" if bits else _words(came // 2)
    if wanted is not None and came != ((wanted + 7) // 8 if bits else 2 * wanted):
        return f"answers with {has}, {wanted} {'was' if wanted == 1 else 'were'} asked for"
    return f"answers with {has}" if came == 0 else None


def _bytes(count: int) -> str:
    return "1 byte" if count == 1 else f"{count} bytes"


def _words(count: int) -> str:
    return "1 word" if count == 1 else f"{count} words"
