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
        cells = _going_on([_between_bars(line) for line in lines])
    elif not re.search(r"[,;\t]", titles) and re.search(r" {2,}", titles):
        cells = _between_gaps(lines)
    else:
        return data
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows([row if any(row) else [] for row in cells])
    return out.getvalue().encode()


def _between_bars(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]


def _going_on(rows: list[list[str]]) -> list[list[str]]:
    """*rows*, where one whose first cell is empty goes on with the cells above it."""
    last: list[str] | None = None
    for number, row in enumerate(rows):
        if last is not None and any(row) and not row[0] and len(row) == len(last):
            last[:] = [f"{above} {below}".strip() for above, below in zip(last, row, strict=True)]
            rows[number] = []
        elif any(row):
            last = row if number else None
    return rows


def _between_gaps(lines: list[str]) -> list[list[str]]:
    """The cells of each line. A line that begins further in than the titles goes on with the cells above it."""
    cells: list[list[str]] = []
    titles = next(line for line in lines if line.strip())
    starts = [gap.end() for gap in re.finditer(r"^ *| {2,}(?=\S)", titles)]
    row: list[str] | None = None
    for line in lines:
        found = [(piece.start(), piece[0]) for piece in re.finditer(r"\S+(?: \S+)*", line)]
        if row is None or not found or found[0][0] <= starts[0] + 1:
            cells.append(_divided(found, starts))
            # What stands below the titles is no part of them.
            row = cells[-1] if len(cells) > 1 and found and line is not titles else row
            continue
        cells.append([])
        for start, text in found:
            column = max(place for place, begin in enumerate(starts) if begin <= start + 1 or place == 0)
            row.extend([""] * (column + 1 - len(row)))
            row[column] = f"{row[column]} {text}".strip()
    return cells


def _divided(found: list[tuple[int, str]], starts: list[int]) -> list[str]:
    """The cells of a line; of one that leaves some too few, a text is divided where a word stands below a title.

    Where each text begins below a title, the cells between them are empty.
    """
    cells: list[str] = []
    lacking = len(starts) - len(found)
    for start, text in found:
        cuts = [begin - start for begin in starts if 0 < begin - start < len(text) and text[begin - start - 1] == " "]
        cuts = cuts[:lacking] if lacking > 0 else []
        lacking -= len(cuts)
        cells += [text[one:other].strip() for one, other in zip([0, *cuts], [*cuts, len(text)], strict=True)]
    below = [next((place for place, begin in enumerate(starts) if abs(begin - start) <= 1), None) for start, _ in found]
    if len(cells) == len(found) < len(starts) and None not in below:
        by_place = dict(zip(below, cells, strict=True))
        return [by_place.get(place, "") for place in range(len(starts))]
    return cells
