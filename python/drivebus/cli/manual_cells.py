"""Cells of a manual's table: what one of them says, and what may mean two things."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from drivebus import tables
from drivebus.cli.wrong_use import WrongUse

__all__ = [
    "COUNTS",
    "SCALES",
    "TableRow",
    "UnclearAddresses",
    "count_of",
    "default_of",
    "is_code",
    "place_of",
    "place_of_code",
    "take_choices",
    "take_range",
    "take_step",
]

COUNTS = ("hex", "decimal", "40001", "group.index")
"""How addresses may be written: in hexadecimal, in decimal, as numbers of registers from 40001 on, or by the code of a
parameter alone, of which P05.06 is at 0506H."""

_UNIT = r"Hz|kHz|A|V|%|rpm|r/min|kW|W|ms|s|min|h|°C|℃|kWh|N·?m|deg(?:\.|rees?)? ?C"
_STEP = re.compile(rf"(?:unit:? ?)?(?P<step>\d+(?:\.\d+)?)? ?(?P<unit>{_UNIT})?")
_NUMBER = r"[-+]?\d+(?:\.\d+)?"
_RANGE = re.compile(
    rf"(?P<low>{_NUMBER}) ?(?:{_UNIT})? ?(?:-|\u2013|~|to|\u2026|\.\.\.?) ?(?P<high>{_NUMBER}) ?(?P<unit>{_UNIT})?"
    rf"(?: ?[(\[](?:step:? ?)?(?P<step>\d+(?:\.\d+)?) ?(?P<of>{_UNIT})?[)\]])?"
)
"""`0.1-600.0 s (0.1 s)`: ends, unit and step."""
_BITS = re.compile(
    r"\b[Bb]its? ?(?P<first>\d{1,2})(?: ?(?:-|to|\.\.+) ?(?P<last>\d{1,2}))?[:=]? +(?P<label>[A-Za-z][^,;.:=()]*?)"
    r"(?= ?(?:[,;.:=()']|\b[Bb]its?\b|$))"
)
"""`Bit 4: motor turns`, `bits 2-3 mode`: what a bit is called."""
_SIGNED = re.compile(
    r"signed|with (a )?sign|(16 ?bit,? )?two'?s'? complement"
    r"|(is )?(negative|below zero|-|minus) .*(backwards?|reverse.*)",
    re.IGNORECASE,
)
"""There are values below zero."""
_UP_TO = re.compile(
    rf"(?P<low>{_NUMBER}) ?(?:-|\u2013|~|to|\u2026|\.\.\.?) ?(?P<code>[A-Za-z]{{0,3}}\d{{0,3}}[.-]\d{{1,3}})"
)
"""`0 ... P00.03`: up to what a parameter says."""
_HEX = r"0x[0-9a-f]+|[0-9a-f]{1,4}h|(?=.*[a-f])[0-9a-f]{1,4}"
"""What is in hexadecimal beyond doubt."""
SCALES = (1, 10, 100, 1000, 10000)
"""How many counts one unit may have."""
_CODE = re.compile(r"[A-Z]{0,3}\.?\d{1,3}[.-]\d{1,3}|[A-Z]{1,3}-\d{1,4}|[A-Z]{1,3}\.? ?\d{2,4}|[a-z][A-Za-z0-9]{2,3}")
"""P05.06, F0-01, 02-00, C-02, C014, Pr.117, tFr: how makers call parameters. A number alone may be that of the row."""
_MARK = re.compile(r"(?<![\w.+-])(\d{1,3}) ?[:=\uff1a] ?")
"""The number before what it means: `0: keypad`, `2=bus`."""
_BARE_MARK = re.compile(r"(?<![\w.+-])(\d{1,3}) (?=[A-Za-z])")
"""The same with nothing between them: `0 keypad 1 terminals`. Numbers that count up are that, units are not."""


class Printed(NamedTuple):
    """A range whose step is not known, as the table has it, and the factory value."""

    low: str
    high: str
    unit: str
    default: str


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
        high_from: The parameter that is the highest value, or empty.
        signed: Whether the table says that there are values below zero.
        printed: A range whose step is not known.
        access: As `registers.csv` has it.
        code: That of a parameter; empty for a register.
        default: As it is printed, or empty.
        choices: What the values of a parameter mean.
        notes: What was not taken over.
        untaken: A range that was not, as it is printed.
        source: Where it is printed: document and page.
        variant: Which variant of the profile has its unit and scale, or empty.
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
    code: str = ""
    default: str = ""
    choices: dict[int, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    untaken: str = ""
    source: str = ""
    variant: str = ""
    high_from: str = ""
    signed: bool = False
    printed: Printed | None = None

    @property
    def place(self) -> int:
        """Where it is, with its table."""
        return tables.place(self.table, self.address)

    @property
    def shown(self) -> str:
        """Where it is, in words."""
        return tables.shown(self.place)

    @property
    def bits(self) -> dict[tuple[int, int], str]:
        """What its notes call bits: the highest and the lowest one of each, and a name of one word."""
        found: dict[tuple[int, int], str] = {}
        for said in _BITS.finditer(" ".join(self.notes)):
            name = "_".join(re.findall(r"[a-z0-9]+", said["label"].lower())[:3])
            ends = sorted((int(said["first"]), int(said["last"] or said["first"])), reverse=True)
            is_new = name not in found.values() and not any(low <= ends[0] and ends[1] <= high for high, low in found)
            if name[:1].isalpha() and ends[0] <= 15 and is_new:
                found[ends[0], ends[1]] = name
        return found

    @property
    def note(self) -> str:
        """What was not taken over, as the profile says it."""
        return "; ".join([*self.notes, *([f"the table has the range {self.untaken}"] if self.untaken else [])])

    def take_range(self, low: str, high: str) -> None:
        """What it may be, whatever its table has."""
        self.low, self.high, self.high_from = low, high, ""
        self.untaken, self.printed = "", None

    def without_unit(self) -> None:
        """Leaves the unit to the note, and the step with it: it is something else."""
        self.notes.append(f"the table has {self.unit!r} as its unit")
        self.unit, self.scale = "", None
        if self.low or self.high or self.high_from:
            self.without_range()

    def without_range(self) -> None:
        """Leaves the range to the note: it does not fit the step."""
        self.untaken = f"{self.low} to {self.high or self.high_from}"
        self.low = self.high = self.high_from = ""

    def by_decimals(self) -> None:
        """Takes the last decimal of the range that is printed for one count."""
        if self.printed is None:
            return
        decimals = max(len(end.partition(".")[2]) for end in (self.printed.low, self.printed.high))
        if 10**decimals in SCALES:
            self.scale, self.unit = 10**decimals, self.unit or self.printed.unit
            self.take_printed()

    def take_printed(self) -> None:
        """Takes the range that is printed, now that the step is known."""
        if self.printed is not None:
            low, high, _, self.default = self.printed
            self.take_range(low, high)


class UnclearAddresses(WrongUse):
    """The addresses of a table may be hexadecimal or decimal."""


def count_of(title: str, cells: Sequence[str]) -> str:
    """How the addresses are written.

    Raises:
        UnclearAddresses: They may be hexadecimal or decimal.
    """
    said = [cell.strip().lower() for cell in cells if cell.strip()]
    if "hex" in title.lower() or any(re.fullmatch(_HEX, one) for one in said):
        return "hex"
    if "dec" in title.lower():
        return "decimal"
    if said and all(re.fullmatch(r"[34]\d{4}|[34]0\d{4}", one) for one in said if one.isdigit()):
        return "40001"
    raise UnclearAddresses(
        f"addresses such as {said[0] if said else 'none'} may be hexadecimal or decimal; "
        "the manual says which: give --addresses hex or --addresses decimal"
    )


def place_of(cell: str, count: str) -> tuple[str, int] | None:
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


def take_step(row: TableRow, cells: dict[str, str]) -> None:
    """Unit and scale, from a step such as `0.01Hz`, a unit, or counts in one unit."""
    step = None
    for what in ("unit", "step", "scale", "says"):
        said = _plain(cells.get(what, ""))
        if not said or said == "-":
            continue
        found = _STEP.fullmatch(said)
        if found is None:
            # `0.1 %, signed`, `0.1 Hz, 0 ... P00.03`
            first, _, rest = said.partition(",")
            found = _STEP.fullmatch(first.strip()) if first.strip() else None
            if found is not None and _SIGNED.fullmatch(rest.strip()):
                row.signed = True
            elif found is not None and not cells.get("range") and _ends(rest.strip()):
                cells["range"] = rest.strip()
            elif found is not None:
                row.notes.append(f"the table says {rest.strip()!r}")
        if found is None and what == "says" and _SIGNED.fullmatch(said):
            row.signed = True
        elif found is None and what == "says" and not cells.get("range") and _ends(said):
            cells["range"] = said
        elif found is None:
            row.notes.append(f"the table says {said!r}" if what == "says" else f"the table has {said!r} as its {what}")
        if found is None:
            continue
        row.unit = row.unit or _unit(found["unit"])
        if found["step"]:
            number = Fraction(found["step"])
            # Counts in one unit, where it is more than one and the column does not call it a step.
            step = 1 / number if what == "scale" and number > 1 else number
    between = _RANGE.fullmatch(_plain(cells.get("range", "")))
    if between is not None:
        row.unit = row.unit or _unit(between["of"] or between["unit"])
        step = Fraction(between["step"]) if step is None and between["step"] else step
    if step is None:
        # Where no column has a step or a unit, nothing says that there is none. A value with decimals has one.
        is_told = any(cells.get(what) is not None for what in ("unit", "step", "scale"))
        has_decimals = any(re.search(r"\d[.,]\d", cells.get(what, "")) for what in ("range", "low", "high", "default"))
        is_plain = not row.unit and not row.notes and not cells.get("unit") and not has_decimals
        row.scale = 1 if is_told and is_plain else None
    elif step and 1 / step in SCALES:
        row.scale = int(1 / step)
    else:
        row.notes.append(f"the table has steps of {float(step):g}")


def _unit(said: str | None) -> str:
    return re.sub(r"deg(?:\.|rees?)? ?C|℃", "°C", (said or "").replace("r/min", "rpm"))


def take_range(row: TableRow, cells: dict[str, str]) -> None:
    """The lowest and the highest value, where the step is known: else the range goes into the note."""
    low, high = _plain(cells.get("low", "")), _plain(cells.get("high", ""))
    said = _plain(cells.get("range", "")) or f"{low}-{high}".strip("-")
    found, up_to = _RANGE.fullmatch(said), _UP_TO.fullmatch(said)
    ends, _, rest = said.partition(", ")
    if found is None and up_to is None and _RANGE.fullmatch(ends):
        # `0.0 to 60.0 s, 0.0 is off`
        found, said = _RANGE.fullmatch(ends), ends
        row.notes.append(f"the table says {rest!r}")
    if found is not None and row.scale is not None:
        row.low, row.high = found["low"], found["high"]
    elif up_to is not None and row.scale is not None:
        row.low, row.high_from = up_to["low"], up_to["code"]
    elif said:
        row.untaken = said
        if found is not None:
            row.printed = Printed(found["low"], found["high"], _unit(found["unit"]), default_of(cells))


def default_of(cells: dict[str, str]) -> str:
    """The factory value, where the cell begins with a number."""
    found = re.match(r"[-+]?\d+(\.\d+)?(?![\w.])", cells.get("default", ""))
    return "" if found is None else found[0]


def _ends(said: str) -> bool:
    """Whether *said* is a range."""
    return _RANGE.fullmatch(_plain(said)) is not None or _UP_TO.fullmatch(said) is not None


def _plain(cell: str) -> str:
    """*cell* with decimal points: a comma is one, unless three digits behind it may make it a thousand."""
    return re.sub(r"(?<=\d),(?=(?:\d{1,2}|\d{4,})(?!\d))", ".", cell)


def is_code(cell: str) -> bool:
    """Whether *cell* calls a parameter."""
    return _CODE.fullmatch(cell) is not None


def place_of_code(code: str) -> tuple[str, int] | None:
    """Where a parameter is whose group is the high byte and whose index the low one; None where it has no such code."""
    # The letter of F0-01 or U0-00 is a part of the address, and the manual alone says which.
    found = re.fullmatch(r"[PR]?(\d{1,3})[.-](\d{1,3})", code)
    if found is None or max(int(found[1]), int(found[2])) > 0xFF:
        return None
    return ("holding", int(found[1]) << 8 | int(found[2]))


def take_choices(row: TableRow, cells: dict[str, str]) -> bool:
    """What the values of a parameter mean, out of its range or of its description. Whether one of them says that."""
    for what in ("range", "choices", "says", "label"):
        said = cells.get(what, "")
        marks = list(_MARK.finditer(said))
        if len(marks) < 2:
            marks = _counting_up(said)
        if len(marks) < 2:
            continue
        numbers = [int(mark[1]) for mark in marks]
        ends = [*(mark.start() for mark in marks[1:]), len(said)]
        labels = [said[mark.end() : end].strip(" ,;/)(") for mark, end in zip(marks, ends, strict=True)]
        if len({*numbers}) < len(numbers) or not all(labels):
            continue
        row.choices = {number: re.sub("[;=]", ",", label) for number, label in zip(numbers, labels, strict=True)}
        return True
    return False


def _counting_up(said: str) -> list[re.Match[str]]:
    """Where `0 keypad 1 terminals 2 bus` has its numbers; nowhere, where they may be values with their units."""
    marks: list[re.Match[str]] = []
    for mark in _BARE_MARK.finditer(said):
        if not marks or int(mark[1]) > int(marks[-1][1]):
            marks.append(mark)
    if not marks or marks[0].start() != 0 or int(marks[0][1]) > 1:
        return []
    ends = [*(mark.start() for mark in marks[1:]), len(said)]
    labels = [said[mark.end() : end].strip(" ,;") for mark, end in zip(marks, ends, strict=True)]
    return [] if any(re.fullmatch(rf"(?:{_UNIT}|to|or|and)\b.*", label) for label in labels) else marks
