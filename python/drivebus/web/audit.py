"""The tail of the file of writes over the network, for people."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from drivebus.web.view import plain

__all__ = ["tail"]

_BYTES = 64 * 1024
"""Of the end of the file, which are read."""


def tail(path: Path | None, most: int = 100) -> list[dict[str, str]]:
    """The last *most* writes that it has, the newest first; none where it cannot be read."""
    if path is None:
        return []
    try:
        with path.open("rb") as file:
            end = file.seek(0, 2)
            file.seek(max(end - _BYTES, 0))
            lines = file.read(_BYTES).split(b"\n")
    except OSError:
        return []
    # The first is whole only where the file is read from its beginning.
    whole = lines if end <= _BYTES else lines[1:]
    found = [shown for line in whole if (shown := _shown(line)) is not None]
    return found[: -most - 1 : -1]


def _shown(line: bytes) -> dict[str, str] | None:
    try:
        told = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(told, dict):
        return None
    halted = told.get("halted")
    what = f"halted: {halted}" if halted else f"{_list(told.get('registers'))} = {_list(told.get('new'))}"
    old = "" if halted or told.get("old") is None else f"was {_list(told.get('old'))}"
    return {
        "time": plain(str(told.get("time", ""))),
        "client": plain(str(told.get("client", ""))),
        "unit": plain(str(told.get("unit", ""))),
        "what": plain(what),
        "old": plain(old),
        "outcome": plain(str(told.get("outcome", ""))),
    }


def _list(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
