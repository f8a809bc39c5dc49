"""A table that was pasted, out of a PDF file or a web page, as a spreadsheet would save it."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable
from typing import NamedTuple

__all__ = ["as_sheet"]

_RULE = re.compile(r"\|?[ :|+=-]*-[ :|+=-]*\|?")
"""A line that only divides."""
_PLACED = re.compile(r"addr|regist|locat", re.IGNORECASE)
"""What the title of a column of addresses has."""
_PLACE = re.compile(r"(0x)?[0-9a-f]{1,6}h?", re.IGNORECASE)
"""An address, however it is written."""


class _Line(NamedTuple):
    """One line: its cells, and whether it leaves the first one empty, as what goes on with the line above does."""

    cells: list[str]
    goes_on: bool


def as_sheet(data: bytes) -> bytes:
    """*data* with its cells divided by commas, where bars or gaps of two spaces divide them; else as it is."""
    text = data.decode("utf-8-sig", "replace")
    # A line that says nothing stays one, so that lines are counted as they were pasted.
    lines = ["" if _RULE.fullmatch(line.strip()) else line for line in text.splitlines()]
    titles = next((line for line in lines if line.strip()), "")
    if not titles or data[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return data
    if "|" in titles:
        cells = [_between_bars(line) for line in lines]
    elif not re.search(r"[,;\t]", titles.strip()) and re.search(r" {2,}", titles.strip()):
        starts = [gap.end() for gap in re.finditer(r"^ *| {2,}(?=\S)", titles)]
        cells = [_between_gaps(line, starts) for line in lines]
    else:
        return data
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(_joined(cells))
    return out.getvalue().encode()


def _joined(lines: Iterable[_Line]) -> list[list[str]]:
    """The rows of *lines*: one that goes on is a part of the row above it, and leaves an empty one.

    The titles have one line, and an address of its own makes a line a row.
    """
    rows: list[list[str]] = []
    titles: list[str] | None = None
    above: list[str] | None = None
    for cells, goes_on in lines:
        if not any(cells):
            rows.append([])
        elif titles is None:
            titles = cells
            rows.append(cells)
        elif above is None or not goes_on or _has_place(titles, above, cells):
            # What goes on below the titles is no part of them, and nothing goes on with it.
            above = None if above is None and goes_on else cells
            rows.append(cells)
        else:
            above.extend([""] * (len(cells) - len(above)))
            above[: len(cells)] = [f"{one} {other}".strip() for one, other in zip(above, cells, strict=False)]
            rows.append([])
    return rows


def _has_place(titles: list[str], above: list[str], cells: list[str]) -> bool:
    """Whether *cells* have an address, as those *above* them."""
    placed = (columns[1:] for columns in zip(titles, above, cells, strict=False) if _PLACED.search(columns[0]))
    return any(_PLACE.fullmatch(one) and _PLACE.fullmatch(other) for one, other in placed)


def _between_bars(line: str) -> _Line:
    cells = [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
    return _Line(cells, not cells[0])


def _between_gaps(line: str, starts: list[int]) -> _Line:
    """The cells of *line*, below titles that begin at *starts*; one that begins further in has none below the first."""
    found = [(piece.start(), piece[0]) for piece in re.finditer(r"\S+(?: \S+)*", line)]
    if not found or found[0][0] <= starts[0] + 1:
        return _Line(_divided(found, starts), goes_on=False)
    cells = [""] * len(starts)
    for start, text in found:
        column = max(place for place, begin in enumerate(starts) if begin <= start + 1 or place == 0)
        cells[column] = f"{cells[column]} {text}".strip()
    return _Line(cells, goes_on=True)


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
