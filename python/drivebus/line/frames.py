"""Frames in a row of bytes: found by their CRC, whatever stands between them, and put into words."""

from __future__ import annotations

from collections.abc import Iterator

from drivebus import rtu
from drivebus._native import crc16
from drivebus.checks import UNITS
from drivebus.line import huanyang

__all__ = ["frames_in", "in_words", "is_frame", "may_be_of"]


def frames_in(data: bytes) -> list[bytes]:
    """The whole frames in *data*, whatever stands between them: their CRC tells them from chance."""
    frames = []
    at = 0
    while at < len(data):
        frame = next(
            (
                data[at : at + length]
                for length in _lengths(data, at)
                if at + length <= len(data) and is_frame(data[at : at + length])
            ),
            None,
        )
        if frame is None:
            at += 1
        else:
            frames.append(frame)
            at += len(frame)
    return frames


def _lengths(data: bytes, at: int) -> Iterator[int]:
    """How long a frame that begins at *at* may be, by its function: request or answer."""
    head = data[at : at + 7]
    if len(head) < 4 or head[0] > UNITS[-1]:
        return
    function = head[1]
    if function & 0x80:
        yield 5
    elif function in (0x03, 0x04):
        yield 5 + head[2]
        yield 8
    elif function in (0x05, 0x06, 0x08):
        yield 8
        if huanyang.is_sure(data[at : at + 5 + head[2]]):
            yield 5 + head[2]
    elif function in (0x0F, 0x10):
        yield 8
        if len(head) == 7:
            yield 9 + head[6]


def is_frame(data: bytes) -> bool:
    """Whether *data* ends with its own CRC."""
    return len(data) >= 4 and crc16(data[:-2]) == int.from_bytes(data[-2:], "little")


def may_be_of(unit: int, data: bytes) -> bool:
    """Whether *data*, which came where *unit* was asked, may hold an answer of it, whole or damaged.

    Noise, and what others say, does not: then the unit was as silent as if nothing had come.
    """
    frames = frames_in(data)
    return any(frame[0] == unit for frame in frames) or (not frames and unit in data[:-1])


def in_words(frame: bytes) -> str:
    """The fields of *frame*, each with its name."""
    if huanyang.is_sure(frame):
        return huanyang.words(frame, True)
    fields = {name: value for name, value in vars(rtu.decode(frame)).items() if value is not None and name != "crc"}
    return ", ".join(f"{name} {value}" for name, value in fields.items())
