"""A frame whose CRC is right and whose inside is not: what is wrong with it, in words."""

from __future__ import annotations

from drivebus._native import judge, misses
from drivebus.rtu import is_frame

__all__ = ["wrong_inside"]


def wrong_inside(frame: bytes, asked: bytes | None = None) -> str | None:
    """What is wrong inside *frame*, and with which unit; None of what is no frame, or is right.

    Args:
        frame: All of it, the CRC included.
        asked: The request to which it came: what does not answer that is wrong, too.
    """
    if not is_frame(frame):
        return None
    whom = f"unit {frame[0]}" if frame[0] else "all units"
    missed = misses(asked, frame) if asked is not None and is_frame(asked) else None
    if missed is not None:
        return f"{whom} {missed}; the CRC is right"
    _, answers, wrong = judge(frame)
    return None if wrong is None else f"{whom}{'' if answers else ':'} {wrong}; the CRC is right"
