"""Frames in a row of bytes: found by their CRC, whatever stands between them, and put into words."""

from __future__ import annotations

from drivebus import _native, rtu
from drivebus.line import huanyang

__all__ = ["frames_in", "in_words", "may_be_of"]


def frames_in(data: bytes) -> list[bytes]:
    """The whole frames in *data*, of Modbus or of Huanyang's own protocol, whatever stands between them."""
    return [data[start:end] for start, end in _native.all_frames_in(data)]


def may_be_of(unit: int, data: bytes) -> bool:
    """Whether *data*, which came where *unit* was asked, may hold an answer of it, whole or damaged.

    Noise, and what others say, does not: then the unit was as silent as if nothing had come.
    """
    return _native.may_be_of(unit, data)


def in_words(frame: bytes) -> str:
    """The fields of *frame*, each with its name."""
    if huanyang.is_sure(frame):
        return huanyang.words(frame, True)
    fields = {name: value for name, value in vars(rtu.decode(frame)).items() if value is not None and name != "crc"}
    return ", ".join(f"{name} {value}" for name, value in fields.items())
