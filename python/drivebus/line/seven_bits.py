"""Characters of seven data bits, received as eight: told by what stands in the place of the eighth.

A UART sends the lowest data bit first, then the parity bit, then the stop bit, which is 1. So where seven data bits
were sent and eight are expected, the highest bit of each byte is:

| sent | highest bit |
| --- | --- |
| 7E1, 7E2 | makes the number of ones in the byte even |
| 7O1, 7O2 | makes it odd |
| 7N1, 7N2 | 1 |

What the sender had in its eighth bit is lost. Modbus RTU has eight data bits, Modbus ASCII mostly seven; *Modbus over
Serial Line* V1.02, sections 2.5.1 and 2.5.2. Nothing here sends.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product

from drivebus._native import crc16
from drivebus.rtu import is_frame

__all__ = ["SevenBits", "agreed", "ascii_in", "seen_in"]

_FORMATS = {"even": "7E1", "odd": "7O1", "high": "7N2"}
"""The format of each kind of highest bits; `"low"` is 0 in all of them, and none."""

_SAID = {
    "7E1": "7 data bits and even parity (7E1)",
    "7O1": "7 data bits and odd parity (7O1)",
    "7N2": "7 data bits without parity (7N2)",
}
_READS = (0x01, 0x02, 0x03, 0x04)
_FIXED = (0x05, 0x06, 0x08, 0x0F, 0x10)
"""Functions whose answers have eight bytes."""

_MOST_DATA = 4
"""Bytes of data in an answer that is looked at: each lost bit doubles what may have been sent, and fits by chance."""

_LONGEST = 512
"""Bytes that are looked at."""

_ENOUGH = 3
"""Answers that prove it. One whose damage is a single highest bit looks so too, once in some hundred times."""


@dataclass(frozen=True)
class SevenBits:
    """What was sent.

    Attributes:
        kinds: What its highest bits may be: `"even"`, `"odd"`, `"high"`, `"low"`.
        ascii: Whether it is Modbus ASCII; otherwise an answer of Modbus RTU whose eighth bits are lost.
        unit: The address in it.
        wire: The bytes as they came.
    """

    kinds: tuple[str, ...]
    ascii: bool
    unit: int
    wire: bytes

    @property
    def format(self) -> str | None:
        """Its format as far as the bytes tell, such as `"7E1"`.

        None where the highest bits are 0 in all of them: they were received as seven bits, or sent as eight.
        """
        return _FORMATS.get(self.kinds[0])

    def __str__(self) -> str:
        sent = "" if self.format is None else _SAID[self.format]
        if self.ascii:
            return f"Modbus ASCII{f' with {sent}' if sent else ''}"
        return sent or "7 data bits"


def ascii_in(came: bytes) -> SevenBits | None:
    """The first whole frame of Modbus ASCII in *came*, if its highest bits are of one kind, whichever."""
    came = came[:_LONGEST]
    text = bytes(byte & 0x7F for byte in came)
    at = text.find(b":")
    while at >= 0:
        end = text.find(b"\r\n", at)
        if end < 0:
            return None
        kinds = _kinds(came[at : end + 2])
        body = _unhexed(text[at + 1 : end])
        if kinds and body is not None and len(body) >= 3 and sum(body) & 0xFF == 0:
            return SevenBits(kinds, True, body[0], came[at : end + 2])
        at = text.find(b":", at + 1)
    return None


def seen_in(unit: int, came: bytes) -> SevenBits | None:
    """What *came* where *unit* was asked in Modbus RTU, if it was sent in seven bits: Modbus ASCII, or an answer of it.

    An answer is one if some choice of the lost bits makes its CRC right, and the highest bits are of one kind.
    """
    found = ascii_in(came)
    if found is not None:
        return found
    came = came[:_LONGEST]
    for at in range(len(came)):
        for length in _lengths(came[at : at + 3]):
            frame = came[at : at + length]
            if len(frame) < length or (frame[0] ^ unit) & 0x7F or is_frame(frame):
                continue
            kinds = _kinds(frame)
            if kinds and _may_have_been(unit, frame):
                return SevenBits(kinds, False, unit, frame)
    return None


def agreed(answers: Iterable[SevenBits | None]) -> SevenBits | None:
    """What most of *answers* show, and all of those that show something, if that is enough to be sure of it."""
    told = list(answers)
    seen = [each for each in told if each is not None]
    if not seen:
        return None
    common = tuple(kind for kind in seen[0].kinds if all(kind in each.kinds for each in seen))
    sure = any(each.ascii for each in seen) or (len(seen) >= _ENOUGH and 2 * len(seen) >= len(told))
    return replace(seen[0], kinds=common) if common and sure else None


def _kinds(frame: bytes) -> tuple[str, ...]:
    """What the highest bits of *frame* may be. An answer of eight data bits has a kind by chance, if it is short."""
    ones = [byte.bit_count() % 2 for byte in frame]
    high = [byte >> 7 for byte in frame]
    kinds = {"even": not any(ones), "odd": all(ones), "high": all(high), "low": not any(high)}
    return tuple(kind for kind, fits in kinds.items() if fits)


def _unhexed(text: bytes) -> bytes | None:
    try:
        return bytes.fromhex(text.decode("ascii")) if text.isalnum() else None
    except ValueError:
        return None


def _lengths(head: bytes) -> Iterator[int]:
    """How long an answer may be whose first bytes are *head*, without their highest bits."""
    if len(head) < 3:
        return
    function, third = head[1] & 0x7F, head[2] & 0x7F
    if function in _READS and 1 <= third <= _MOST_DATA:
        yield 5 + third
    elif function in _FIXED:
        yield 8
    if 1 <= third <= 0x0B and function in (*_READS, *_FIXED):
        yield 5


def _may_have_been(unit: int, frame: bytes) -> bool:
    """Whether some bits in the place of the highest ones in *frame* make it one of *unit* with its CRC.

    Those of the address, of the function, of a count, of an exception and of the sub-function of an echo are known.
    """
    low = bytes(byte & 0x7F for byte in frame)
    is_refusal = len(frame) == 5
    head = bytes((unit, low[1] | (0x80 if is_refusal else 0), low[2]))
    known = low[3:4] if low[1] == 0x08 and len(frame) == 8 else b""
    data = low[3 + len(known) : -2]
    for bits in product((0, 0x80), repeat=len(data)):
        crc = crc16(head + known + bytes(byte | bit for byte, bit in zip(data, bits, strict=True)))
        if (crc ^ int.from_bytes(low[-2:], "little")) & 0x7F7F == 0:
            return True
    return False
