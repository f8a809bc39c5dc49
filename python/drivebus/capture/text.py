"""Hex text of any tool as frames: a line each, with whatever else stands on it.

Understood are bytes as `01 03 21 00`, `01-03-21-00`, `0x01,0x03`, `[01][03]` (libmodbus) or `010321008E36`. What stands
before them is skipped: a time, an offset, `TX:`, `->`, `request`. A mark that tells the direction is taken.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from drivebus.capture.frame import Captured

__all__ = ["frames"]

_BYTES = re.compile(
    r"(?:(?<![\w.:])(?:0x)?[0-9a-f]{2}(?:(?:[\s,;:-]+|\]\s*\[|><)(?:0x)?[0-9a-f]{2}(?![\w.]))+)|"
    r"(?<![\w.:])(?:[0-9a-f]{2}){4,}(?!\w)",
    re.IGNORECASE,
)
"""Two bytes or more with something between them, or four and more without."""

_MOMENT = re.compile(r"\b\d{4}-\d\d-\d\d\b|\b\d{1,2}:\d\d(?::\d\d(?:[.,]\d+)?)?\b")

_BYTE = re.compile(r"[0-9a-f]{2}(?![0-9a-f]x)", re.IGNORECASE)
_PREFIX = re.compile(r"0x", re.IGNORECASE)
_ASKS = re.compile(r"->|>>|\b(?:tx|send|sent|sending|request|query|master|write)\b", re.IGNORECASE)
_ANSWERS = re.compile(r"<-|<<|\b(?:rx|recv|received|receiving|response|answer|reply|slave|read)\b", re.IGNORECASE)


def frames(text: str) -> Iterator[Captured]:
    """The frames in *text*, one for each line that has one."""
    for written in text.splitlines():
        line = _MOMENT.sub(lambda moment: "_" * len(moment[0]), written)
        found = max(_BYTES.finditer(line), key=lambda match: len(match[0]), default=None)
        if found is None:
            continue
        data = bytes(int(byte, 16) for byte in _BYTE.findall(_PREFIX.sub("", found[0])))
        before = line[: found.start()]
        asks, answers = _ASKS.search(before), _ANSWERS.search(before)
        yield Captured(None, data, None if bool(asks) == bool(answers) else asks is not None)
