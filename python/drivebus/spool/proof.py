"""Whether what stands in a file is what was written: SQLite does not look at what is in its pages."""

from __future__ import annotations

import struct
import zlib
from typing import Any

__all__ = ["is_proven", "proof_of"]


def proof_of(epoch: int, layout: int, at: float, took: float, missing: str, packed: bytes) -> int:
    """A checksum of all that a sample says."""
    head = struct.pack("<qqdd", epoch, layout, at, took)
    return zlib.crc32(packed, zlib.crc32(missing.encode(), zlib.crc32(head)))


def is_proven(row: tuple[Any, ...]) -> bool:
    """Whether a row of the table of samples is as it was written: what it says behind its number, and the checksum."""
    try:
        return bool(row[-1] == proof_of(*row[1:-1]))
    except (AttributeError, TypeError, struct.error):
        return False
