"""A table out of a manual, as rows of `registers.csv`: what its columns and cells say, and what could not be read.

A manual prints addresses, steps and ranges in its own way. What may mean two things is asked for, or left empty with a
note: a guess would be a value that is wrong by a factor of ten.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from drivebus.cli.wrong_use import WrongUse
from drivebus.record.sheets import read_sheet

__all__ = ["COUNTS", "ManualTable", "TableRow"]

COUNTS = ("hex", "decimal", "40001")
"""How addresses may be written: in hexadecimal, in decimal, or as numbers of registers from 40001 on."""

_TITLES = {
    "address": r".*\baddr(ess|\.)?\b.*|register|reg\.?|location",
    "label": r"(function |parameter |register )?(name|description|definition)|function|meaning|item|designation"
    r"|contents?|parameter|explanation|data",
    "unit": r"units?",
    "step": r"resolution|step|increment|precision|accuracy|min(\.|imum)? unit",
    "scale": r"scale|scaling",
    "range": r".*\brange\b.*|limits",
    "low": r"min(\.|imum)?|low",
    "high": r"max(\.|imum)?|high",
    "access": r"r/?w|read/write|access|attributes?|property",
}
_ACCESS = {
    "ro": r"r|ro|read( ?only)?|r only",
    "wo": r"w|wo|write( ?only)?|w only",
    "rw": r"rw|r/w|wr|w/r|read ?/ ?write|read and write",
}
_UNIT = r"Hz|kHz|A|V|%|rpm|r/min|kW|W|ms|s|min|h|°C|℃|kWh|N·?m"
_STEP = re.compile(rf"(?:unit:? ?)?(?P<step>\d+(?:\.\d+)?)? ?(?P<unit>{_UNIT})?")
_NUMBER = r"[-+]?\d+(?:\.\d+)?"
_RANGE = re.compile(rf"({_NUMBER}) ?(?:{_UNIT})? ?(?:-|\u2013|~|to|\u2026|\.\.\.?) ?({_NUMBER}) ?(?:{_UNIT})?")
_HEX = r"0x[0-9a-f]+|[0-9a-f]{1,4}h|(?=.*[a-f])[0-9a-f]{1,4}"
"""What is in hexadecimal beyond doubt."""
_SCALES = (1, 10, 100, 1000, 10000)


@dataclass
class TableRow:
    """One row that could be read.

    Attributes:
        line: Where it stands in the table, from 1.
        address: On the wire, 0..0xFFFF.
        table: `"holding"`, or `"input"` for numbers from 30001 on.
        name: One word, made of its label.
        label: As the manual has it.
        unit: Empty for a plain number.
        scale: Counts in one unit; None where the table does not tell.
        low, high: The range as it is printed, or empty.
        access: As `registers.csv` has it.
        notes: What was not taken over.
    """

    line: int
    address: int
    table: str
    name: str
    label: str
    unit: str = ""
    scale: int | None = None
    low: str = ""
    high: str = ""
    access: str = "unknown"
    notes: list[str] = field(default_factory=list)

    def without_range(self) -> None:
        """Leaves the range to the note: it does not fit the step."""
        self.notes.append(f"the table has the range {self.low} to {self.high}")
        self.low = self.high = ""


class ManualTable:
    """What a table says.

    Attributes:
        rows: What could be read.
        left_out: The line of each row that could not, and why.
    """

    def __init__(self, data: bytes, *, count: str | None = None) -> None:
        """*data* as a spreadsheet saves it; *count* is how its addresses are written, where they do not tell.

        Raises:
            WrongUse: It has no column of addresses or of names, or its addresses may mean two things.
            NotAllowed: It is no such text.
        """
        titles, rows = read_sheet(data, titles_of(data))
        self._places = _columns(titles)
        self._names: dict[str, int] = {}
        self.rows: list[TableRow] = []
        self.left_out: list[tuple[int, str]] = []
        cells = [(line, dict(self._cells(row))) for line, row in rows]
        count = count or _count_of(titles[self._places["address"]], [row["address"] for _, row in cells])
        taken: dict[tuple[str, int], int] = {}
        for line, row in cells:
            place = _place(row["address"], count)
            if place is None:
                self.left_out.append((line, f'"{row["address"]}" is no address of one register'))
            elif not row["label"]:
                self.left_out.append((line, "it has no name"))
            elif place in taken:
                self.left_out.append((line, f"its address is that of line {taken[place]}"))
            else:
                taken[place] = line
                self.rows.append(self._row(line, place, row))

    def _cells(self, row: Sequence[str]) -> Iterator[tuple[str, str]]:
        for what, place in self._places.items():
            yield what, " ".join(row[place].split()) if place < len(row) else ""

    def _row(self, line: int, place: tuple[str, int], cells: dict[str, str]) -> TableRow:
        table, address = place
        row = TableRow(line, address, table, self._name(cells["label"]), cells["label"])
        _take_step(row, cells)
        _take_range(row, cells)
        said = cells.get("access", "").lower()
        row.access = next((access for access, words in _ACCESS.items() if re.fullmatch(words, said)), "unknown")
        if table == "input":
            row.access = "ro"
        return row

    def _name(self, label: str) -> str:
        """One word of the first words of *label*, as no other row has it."""
        words = re.findall(r"[a-z0-9]+", re.sub(r"\(.*?\)", " ", label.lower()))[:5]
        name = "_".join(words)[:40].strip("_") or "register"
        name = name if name[0].isalpha() else f"r_{name}"
        numbered = (f"{name}_{number}" for number in itertools.count(self._names.get(name, 1) + 1))
        new = name if name not in self._names else next(each for each in numbered if each not in self._names)
        # How often it was asked for is where to go on with the numbers.
        self._names[name] = self._names.get(name, 0) + 1
        self._names.setdefault(new, 1)
        return new

    def give_up(self, line: int, reason: str) -> None:
        """What stands in *line* of `csv` cannot be: its range goes into its note; where it has none, the row goes."""
        row = self.rows[line - 2]
        if row.low or row.high:
            row.without_range()
        else:
            self.rows.remove(row)
            self.left_out.append((row.line, reason))

    def csv(self, source: str) -> str:
        """The rows as `registers.csv` has them, by *source*: document and page."""
        text = io.StringIO()
        file = csv.writer(text, lineterminator="\n")
        titles = "address,table,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source"
        file.writerow(titles.split(","))
        for row in self.rows:
            signed = "yes" if row.low.startswith("-") else "no"
            scale = "" if row.scale is None else row.scale
            facts = [f"0x{row.address:04X}", row.table, row.name, row.label, row.unit, scale, signed, row.low, row.high]
            file.writerow([*facts, "", row.access, "yes", "; ".join(row.notes), source])
        return text.getvalue()


def titles_of(data: bytes) -> list[str]:
    """What the titles of a table may be, whatever divides its cells: no number in these columns is turned around."""
    encoding = "utf-16" if data[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig"
    first = next((line for line in data.decode(encoding, "replace").splitlines() if line.strip(",;\t ")), "")
    return [title.strip() for divider in ",;\t" for title in next(csv.reader([first], delimiter=divider), [])]


def _columns(titles: Sequence[str]) -> dict[str, int]:
    """In which column each thing stands; the first of several."""
    places: dict[str, int] = {}
    for place, title in enumerate(titles):
        plain = " ".join(re.sub(r"\(.*?\)", " ", title.lower()).split())
        what = next((what for what, words in _TITLES.items() if re.fullmatch(words, plain)), None)
        if what == "label" and what in places:
            what = "says"
        if what is not None:
            places.setdefault(what, place)
    for what, wanted in (("address", "an address"), ("label", "a name")):
        if what not in places:
            raise WrongUse(
                f"no column of the table is {wanted}: its first line has {', '.join(map(repr, titles)) or 'nothing'}. "
                "Call the columns address, name, unit, scale, range and access; only the first two are needed"
            )
    return places


def _count_of(title: str, cells: Sequence[str]) -> str:
    """How the addresses are written.

    Raises:
        WrongUse: They may be hexadecimal or decimal.
    """
    said = [cell.strip().lower() for cell in cells if cell.strip()]
    if "hex" in title.lower() or any(re.fullmatch(_HEX, one) for one in said):
        return "hex"
    if "dec" in title.lower():
        return "decimal"
    if said and all(re.fullmatch(r"[34]\d{4}|[34]0\d{4}", one) for one in said if one.isdigit()):
        return "40001"
    raise WrongUse(
        f"addresses such as {said[0] if said else 'none'} may be hexadecimal or decimal; "
        "the manual says which: give --addresses hex or --addresses decimal"
    )


def _place(cell: str, count: str) -> tuple[str, int] | None:
    """Table and address of *cell*; None where it is not one register."""
    text = cell.replace(" ", "").lower()
    if count == "hex":
        found = re.fullmatch(r"(?:0x)?([0-9a-f]{1,4})h?", text)
        return ("holding", int(found[1], 16)) if found else None
    if not text.isdecimal() or not text.isascii():
        return None
    if count == "decimal":
        return ("holding", int(text)) if int(text) <= 0xFFFF else None
    if len(text) not in {5, 6} or text[0] not in "34" or int(text[1:]) == 0:
        return None
    address = int(text[1:]) - 1
    return ("holding" if text[0] == "4" else "input", address) if address <= 0xFFFF else None


def _take_step(row: TableRow, cells: dict[str, str]) -> None:
    """Unit and scale, from a step such as `0.01Hz`, a unit, or counts in one unit."""
    step = None
    for what in ("unit", "step", "scale", "says"):
        said = _plain(cells.get(what, ""))
        if not said or said == "-":
            continue
        found = _STEP.fullmatch(said)
        if found is None:
            row.notes.append(f"the table says {said!r}" if what == "says" else f"the table has {said!r} as its {what}")
            continue
        row.unit = row.unit or (found["unit"] or "").replace("r/min", "rpm").replace("℃", "°C")
        if found["step"]:
            number = Fraction(found["step"])
            # Counts in one unit, where it is more than one and the column does not call it a step.
            step = 1 / number if what == "scale" and number > 1 else number
    if step is None:
        # Where no column has a step or a unit, nothing says that there is none.
        is_told = any(cells.get(what) is not None for what in ("unit", "step", "scale"))
        row.scale = 1 if is_told and not row.unit and not row.notes and not cells.get("unit") else None
    elif step and 1 / step in _SCALES:
        row.scale = int(1 / step)
    else:
        row.notes.append(f"the table has steps of {float(step):g}")


def _take_range(row: TableRow, cells: dict[str, str]) -> None:
    low, high = _plain(cells.get("low", "")), _plain(cells.get("high", ""))
    said = _plain(cells.get("range", "")) or f"{low}-{high}".strip("-")
    found = _RANGE.fullmatch(said)
    if found is not None and row.scale is not None:
        row.low, row.high = found[1], found[2]
    elif said:
        row.notes.append(f"the table has the range {said}")


def _plain(cell: str) -> str:
    """*cell* with decimal points: a comma is one, unless three digits behind it may make it a thousand."""
    return re.sub(r"(?<=\d),(?=(?:\d{1,2}|\d{4,})(?!\d))", ".", cell)
