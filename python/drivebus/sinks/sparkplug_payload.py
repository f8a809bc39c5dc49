"""Payloads of Sparkplug B, as bytes: the part of its one protocol buffer that an edge node sends and reads.

Source: Eclipse Sparkplug Specification 3.0.0, section 6.4, "Sparkplug B Payload Definition".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

__all__ = ["Metric", "Payload", "PayloadError"]

_INT64, _DOUBLE, _BOOLEAN, _STRING = 4, 10, 11, 12
"""Data types of metrics, section 6.4.16."""
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
"""How a field is written: protocol buffers, "Encoding"."""
_MOST_BITS = 64


class PayloadError(ValueError):
    """These bytes are no payload."""


@dataclass(frozen=True)
class Metric:
    """One value.

    Attributes:
        name: What it is called.
        value: What it is; None: nothing is known.
        time: Milliseconds of Unix time.
        is_historical: Whether it is older than what a host shows as present.
        unit: Its unit; empty: none, or it was told before.
        kind: The data type where there is no value: that of a `float`, unless it says otherwise.
    """

    name: str
    value: float | bool | str | None
    time: int
    is_historical: bool = False
    unit: str = ""
    kind: type = float

    def packed(self) -> bytes:
        """It, as a message."""
        kind = self.kind if self.value is None else type(self.value)
        parts = [_text(1, self.name), _number(3, self.time), _number(4, _DATA_TYPES[kind])]
        if self.is_historical:
            parts.append(_number(5, 1))
        if self.value is None:
            parts.append(_number(7, 1))
        if self.unit:
            parts.append(_message(9, _text(1, "engUnit") + _message(2, _number(1, _STRING) + _text(8, self.unit))))
        if self.value is not None:
            parts.append(_value(self.value))
        return b"".join(parts)


@dataclass(frozen=True)
class Payload:
    """What one message has.

    Attributes:
        time: Milliseconds of Unix time at which it is sent.
        metrics: The values.
        seq: Its number, 0..255; None for a death of a node, which has none.
    """

    time: int
    metrics: Sequence[Metric]
    seq: int | None

    def packed(self) -> bytes:
        """It, as bytes."""
        metrics = b"".join(_message(2, metric.packed()) for metric in self.metrics)
        return _number(1, self.time) + metrics + (b"" if self.seq is None else _number(3, self.seq))

    @classmethod
    def read(cls, packed: bytes) -> Payload:
        """What *packed* says, as far as an edge node has to know: names, times and plain values.

        Raises:
            PayloadError: It is something else.
        """
        time, seq, metrics = 0, None, []
        for field, value in _fields(packed):
            if field == 1:
                time = _whole(value)
            elif field == 2:
                metrics.append(_read_metric(_raw(value)))
            elif field == 3:
                seq = _whole(value)
        return cls(time, tuple(metrics), seq)


_DATA_TYPES: dict[type, int] = {int: _INT64, float: _DOUBLE, bool: _BOOLEAN, str: _STRING}


def _value(value: float | bool | str) -> bytes:
    if isinstance(value, bool):
        return _number(14, int(value))
    if isinstance(value, int):
        return _number(11, value % (1 << _MOST_BITS))
    if isinstance(value, float):
        return _key(13, _FIXED64) + struct.pack("<d", value)
    return _text(15, value)


def _key(field: int, kind: int) -> bytes:
    return _varint(field << 3 | kind)


def _varint(number: int) -> bytes:
    packed = bytearray()
    while number > 0x7F:
        packed.append(number & 0x7F | 0x80)
        number >>= 7
    packed.append(number)
    return bytes(packed)


def _number(field: int, number: int) -> bytes:
    return _key(field, _VARINT) + _varint(number)


def _message(field: int, packed: bytes) -> bytes:
    return _key(field, _BYTES) + _varint(len(packed)) + packed


def _text(field: int, text: str) -> bytes:
    # Half of a character that stands for itself is in no UTF-8.
    return _message(field, text.encode(errors="replace"))


def _read_metric(packed: bytes) -> Metric:
    name, time, kind = "", 0, _DOUBLE
    historical = False
    value: float | bool | str | None = None
    for field, found in _fields(packed):
        if field == 1:
            name = _words(found)
        elif field == 3:
            time = _whole(found)
        elif field == 4:
            kind = _whole(found)
        elif field == 5:
            historical = bool(_whole(found))
        elif field in (10, 11):
            value = _whole(found)
        elif field in (12, 13):
            [value] = struct.unpack("<f" if field == 12 else "<d", _raw(found, 4 if field == 12 else 8))
        elif field == 14:
            value = bool(_whole(found))
        elif field == 15:
            value = _words(found)
    if kind == _INT64 and isinstance(value, int) and value >= 1 << _MOST_BITS - 1:
        value -= 1 << _MOST_BITS
    if isinstance(value, float) and not math.isfinite(value):
        value = None
    return Metric(name, value, time, historical)


def _fields(packed: bytes) -> Iterator[tuple[int, int | bytes]]:
    place = 0
    while place < len(packed):
        key, place = _read_varint(packed, place)
        kind = key & 7
        if kind == _VARINT:
            number, place = _read_varint(packed, place)
            yield key >> 3, number
            continue
        if kind == _BYTES:
            size, place = _read_varint(packed, place)
        else:
            size = {_FIXED64: 8, _FIXED32: 4}.get(kind, -1)
        if size < 0 or place + size > len(packed):
            raise PayloadError(f"field {key >> 3} is cut off, or of a kind that there is not")
        yield key >> 3, packed[place : place + size]
        place += size


def _read_varint(packed: bytes, place: int) -> tuple[int, int]:
    number = 0
    for shift in range(0, _MOST_BITS + 6, 7):
        if place >= len(packed):
            break
        number |= (packed[place] & 0x7F) << shift
        place += 1
        if not packed[place - 1] & 0x80:
            return number % (1 << _MOST_BITS), place
    raise PayloadError("a number is cut off, or too long")


def _whole(value: int | bytes) -> int:
    if isinstance(value, bytes):
        raise PayloadError("a number is expected, and something else is there")
    return value


def _raw(value: int | bytes, size: int | None = None) -> bytes:
    if isinstance(value, int) or (size is not None and len(value) != size):
        raise PayloadError("a message is expected, and something else is there")
    return value


def _words(value: int | bytes) -> str:
    try:
        return _raw(value).decode()
    except UnicodeDecodeError:
        raise PayloadError("a name is not in UTF-8") from None
