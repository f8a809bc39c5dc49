"""Moments as they are shown: in UTC for programs, and as the time of day for people."""

from __future__ import annotations

from datetime import datetime, timezone

__all__ = ["moment", "time_of_day"]


def moment(time: float) -> str:
    """A Unix time in seconds as ISO 8601 in UTC."""
    return datetime.fromtimestamp(time, timezone.utc).isoformat(timespec="microseconds")


def time_of_day(time: float) -> str:
    """A Unix time in seconds as hours, minutes and seconds here, with four places."""
    return datetime.fromtimestamp(time).astimezone().isoformat(sep=" ", timespec="microseconds")[11:26]
