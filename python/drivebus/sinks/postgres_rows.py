"""Samples as PostgreSQL's COPY takes them in binary: every number as it is, and a third of the work of text.

Source: PostgreSQL's documentation, COPY, "Binary Format".
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from drivebus.spool import Spooled

__all__ = ["FIXED", "as_copy", "clean"]

FIXED = {
    "gateway": "text NOT NULL",
    "epoch": "text NOT NULL",
    "seq": "bigint NOT NULL",
    "time": "timestamptz NOT NULL",
    "took": "double precision NOT NULL",
    "drive": "text NOT NULL",
    "missing": "text",
}
"""The columns that each table of samples begins with, and their types."""

_HEAD = b"PGCOPY\n\xff\r\n\0" + struct.pack(">ii", 0, 0)
_END = struct.pack(">h", -1)
_NULL = struct.pack(">i", -1)
_NUMBERS = struct.Struct(">iqiqid")
_YEAR_2000 = 946_684_800
"""Unix time from which PostgreSQL counts."""
_EARLIEST, _LATEST = -62_135_596_800.0, 253_402_300_800.0
"""The years 1 to 9999: what a clock may say, and what any program can show."""
_NEVER = (1 << 63) - 1
"""PostgreSQL's `infinity`."""


def as_copy(gateway: str, samples: Sequence[Spooled]) -> bytes:
    """All *samples*, whose layouts have the same names, for the columns of `FIXED` and one for each name."""
    parts = [_HEAD]
    width = len(samples[0].layout.names)
    packer = struct.Struct(">" + "id" * width)
    cells: list[float] = [8, 0.0] * width
    leads: dict[str, bytes] = {}
    drives: dict[str, bytes] = {}
    for seq, epoch, layout, at, took, missing, values in samples:
        if epoch not in leads:
            leads[epoch] = struct.pack(">h", len(FIXED) + width) + _text(gateway) + _text(epoch)
        if layout.drive not in drives:
            drives[layout.drive] = _text(layout.drive)
        parts += (leads[epoch], _NUMBERS.pack(8, seq, 8, _moment(at), 8, took), drives[layout.drive])
        if missing:
            parts += (_text(missing), _NULL * width)
        else:
            cells[1::2] = values
            parts += (_NULL, packer.pack(*cells))
    parts.append(_END)
    return b"".join(parts)


def clean(text: str) -> str:
    """*text* without the one character that PostgreSQL does not take."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


def _text(text: str) -> bytes:
    data = clean(text).encode("utf-8", "replace")
    return struct.pack(">i", len(data)) + data


def _moment(at: float) -> int:
    # A clock that shows nonsense keeps no sample from being delivered.
    return round((at - _YEAR_2000) * 1e6) if _EARLIEST <= at < _LATEST else _NEVER
