"""Samples as rows of PostgreSQL, by COPY in binary: numbers as they are, for a quarter of the work of text."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone

from psycopg import Copy

from drivebus.spool import Spooled

__all__ = ["FIXED", "clean", "write", "write_events"]

FIXED = {
    "gateway": "text NOT NULL",
    "epoch": "text NOT NULL",
    "seq": "bigint NOT NULL",
    "time": "timestamptz NOT NULL",
    "took": "double precision NOT NULL",
    "drive": "text NOT NULL",
    "missing": "text",
}
"""The columns that each table of samples begins with, and what they are."""

_OF_EVENT = ("text", "text", "int8", "timestamptz", "text", "text", "text")
_TYPES = ("text", "text", "int8", "timestamptz", "float8", "text", "text")
_YEAR_9999 = 253_370_764_800.0
_NEVER = datetime.max.replace(tzinfo=timezone.utc)


def write(copy: Copy, gateway: str, samples: Sequence[Spooled]) -> None:
    """Writes *samples*, whose layouts have the same names, into the columns of `FIXED` and one for each name."""
    width = len(samples[0].layout.names)
    copy.set_types([*_TYPES, *("float8",) * width])
    nothing = (None,) * width
    for seq, epoch, layout, at, took, missing, values in samples:
        cells = nothing if missing else values
        drive = clean(layout.drive)
        copy.write_row((gateway, epoch, seq, _moment(at), took, drive, clean(missing) if missing else None, *cells))


def write_events(copy: Copy, gateway: str, events: Sequence[Spooled]) -> None:
    """Writes *events* into the columns of their table, as they stand there."""
    copy.set_types(_OF_EVENT)
    for seq, epoch, layout, at, _, text, _ in events:
        copy.write_row((gateway, epoch, seq, _moment(at), clean(layout.drive), clean(layout.event), clean(text)))


def clean(text: str) -> str:
    """*text* without the one character that PostgreSQL does not take."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


def _moment(at: float) -> datetime:
    # A clock that shows nonsense keeps no sample from being delivered.
    return datetime.fromtimestamp(at, timezone.utc) if 0.0 <= at < _YEAR_9999 else _NEVER
