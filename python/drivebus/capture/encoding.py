"""Bytes of a text file as text, whichever program wrote it."""

from __future__ import annotations

import codecs
import re

__all__ = ["decoded"]

_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_LOOKED_AT = 4096
_COLOUR = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def decoded(data: bytes) -> str:
    """The text in *data*: UTF-8, UTF-16 of either order, with or without a mark, or else Latin-1.

    Colours of a terminal are left out, and so are bytes of zero, with which some programs fill a file up.
    """
    for mark, name in _BOMS:
        if data.startswith(mark):
            return _plain(data[len(mark) :].decode(name, "replace"))
    wide = _wide(data[:_LOOKED_AT])
    if wide is not None:
        return _plain(data.decode(wide, "replace"))
    try:
        return _plain(data.decode())
    except UnicodeDecodeError:
        return _plain(data.decode("latin-1"))


def _plain(text: str) -> str:
    return _COLOUR.sub("", text.replace("\0", ""))


def _wide(head: bytes) -> str | None:
    """UTF-16 without a mark: every other byte of the Latin alphabet is zero, on one side only."""
    pairs = len(head) // 2
    if pairs < 2:
        return None
    first, second = head[0 : 2 * pairs : 2].count(0), head[1 : 2 * pairs : 2].count(0)
    if second * 2 > pairs and first * 10 < pairs:
        return "utf-16-le"
    if first * 2 > pairs and second * 10 < pairs:
        return "utf-16-be"
    return None
