"""The text of any tool as frames in their order, each with who sent it as far as that can be told."""

from __future__ import annotations

import re
from collections.abc import Iterator

from drivebus import checks
from drivebus.capture.finding import pieces
from drivebus.capture.frame import Captured
from drivebus.capture.speakers import Speakers, without_repeats

__all__ = ["LOOKED_FOR", "frames", "heard"]

LOOKED_FOR = (
    "looked for: bytes as hexadecimal, decimal, octal or binary numbers, or as text with escapes, on one line or over "
    "several, with a CRC of Modbus RTU or a head of Modbus TCP"
)

_ASCII = re.compile(r":((?:[0-9A-Fa-f]{2}){3,})(?![0-9A-Za-z])")


def frames(text: str) -> Iterator[Captured]:
    """The frames in *text*, and the bytes that look as if they were meant and are in none."""
    yield from heard(text)[0]


def heard(text: str) -> tuple[list[Captured], list[str]]:
    """As `frames`, and what is to be said of them."""
    found, repeats = without_repeats(pieces(text))
    speakers = Speakers(found)
    told = [
        Captured(
            None,
            piece.data,
            speakers.asks(piece) if piece.is_frame else None,
            at_once=piece.transaction is not None,
        )
        for piece in found
    ]
    return told, list(_remarks(text, repeats, sum(piece.transaction is not None for piece in found)))


def _remarks(text: str, repeats: int, by_tcp: int) -> Iterator[str]:
    if by_tcp:
        added = "its is" if by_tcp == 1 else "theirs are"
        yield f"{checks.counted(by_tcp, 'frame')} of Modbus TCP, which has no CRC: {added} added here"
    if repeats:
        yield f"{checks.counted(repeats, 'frame')} told twice by the tool: shown once"
    lines = [number for number, line in enumerate(text.splitlines(), 1) if any(map(_is_ascii, _ASCII.findall(line)))]
    if lines:
        yield f"line {lines[0]} is Modbus ASCII, its LRC is right; here only RTU and TCP are taken apart"


def _is_ascii(digits: str) -> bool:
    """Whether *digits* are a frame of Modbus ASCII: all its bytes add up to zero."""
    return sum(bytes.fromhex(digits)) & 0xFF == 0
