"""A table that was pasted, out of a PDF file or a web page, as a spreadsheet would save it."""

from __future__ import annotations

import csv
import io
import re

__all__ = ["as_sheet"]

_RULE = re.compile(r"\|?[ :|+=-]*-[ :|+=-]*\|?")
"""A line that only divides."""


def as_sheet(data: bytes) -> bytes:
    """*data* with its cells divided by commas, where bars or gaps of two spaces divide them; else as it is."""
    text = data.decode("utf-8-sig", "replace")
    # A line that says nothing stays one, so that lines are counted as they were pasted.
    lines = ["" if _RULE.fullmatch(line.strip()) else line for line in text.splitlines()]
    titles = next((line.strip() for line in lines if line.strip()), "")
    if not titles or data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return data
    if "|" in titles:
        cells = [_between_bars(line) for line in lines]
    elif not re.search(r"[,;\t]", titles) and re.search(r" {2,}", titles):
        cells = [re.split(r" {2,}", line.strip()) for line in lines]
    else:
        return data
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([row if any(row) else [] for row in cells])
    return out.getvalue().encode()


def _between_bars(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
