"""What the samples of one drive have, and how their values are packed: the same for each, so it is written once.

An event has no values: its layout says of what and of which kind it is.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from drivebus.values import Value

__all__ = ["Layout"]

_SMALL, _LARGE = b"i", b"d"
"""How values are packed: as whole numbers of their last digit, four bytes each, or as they are, eight."""


@dataclass(frozen=True)
class Layout:
    """What the samples of one drive have.

    Attributes:
        drive: What it is called.
        family: The name of its profile; empty where none is known.
        names: Of its values.
        units: Of each; empty where it has none.
        digits: Of each behind the point, as its drive counts.
        event: Which kind of event it is, which has its words where a sample says why it has no values; empty: a sample.
    """

    drive: str
    family: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    digits: tuple[int, ...]
    event: str = ""

    @classmethod
    def of_events(cls, subject: str, kind: str) -> Layout:
        """That of the events of one *kind* at *subject*: a drive, a line or something else that has a name."""
        return cls(subject, "", (), (), (), kind)

    def text(self) -> str:
        """All of it, for `of_text`."""
        told = [self.drive, self.family, self.names, self.units, self.digits, self.event]
        return json.dumps(told, ensure_ascii=False)

    @classmethod
    def of_text(cls, text: str) -> Layout:
        """What `text` gave.

        Raises:
            ValueError: It is something else.
        """
        drive, family, names, units, digits, event = json.loads(text)
        return cls(drive, family, tuple(names), tuple(units), tuple(digits), event)

    def packed(self, values: Sequence[Value]) -> bytes:
        """*values*, one for each name: none of them is changed by it."""
        whole = [round(value * factor) for value, factor in zip(values, self._factors, strict=True)]
        is_small = all(
            -0x80000000 <= number <= 0x7FFFFFFF and number / factor == value
            for number, factor, value in zip(whole, self._factors, values, strict=True)
        )
        if is_small:
            return _SMALL + struct.pack(f"<{len(whole)}i", *whole)
        return _LARGE + struct.pack(f"<{len(values)}d", *values)

    def values(self, packed: bytes) -> tuple[Value, ...]:
        """What `packed` gave: whole numbers where its drive counts no digits behind the point.

        Raises:
            ValueError: It is something else.
        """
        kind = packed[:1]
        if kind not in (_SMALL, _LARGE):
            raise ValueError(f"values begin with {kind!r}")
        try:
            numbers = struct.unpack(f"<{len(self.names)}{kind.decode()}", packed[1:])
        except struct.error as error:
            raise ValueError(str(error)) from None
        if kind == _LARGE:
            pairs = zip(numbers, self.digits, strict=True)
            return tuple(int(number) if not digits and _is_whole(number) else number for number, digits in pairs)
        pairs = zip(numbers, self._factors, strict=True)
        return tuple(number if factor == 1 else number / factor for number, factor in pairs)

    @cached_property
    def _factors(self) -> tuple[int, ...]:
        return tuple(10**digits for digits in self.digits)


def _is_whole(number: float) -> bool:
    return math.isfinite(number) and number == int(number)
