"""Tables out of a manual, as rows of a profile: what their columns and cells say, and what could not be read.

A manual prints addresses, steps and ranges in its own way. What may mean two things is asked for, or left empty with a
note: a guess would be a value that is wrong by a factor of ten.
"""

from __future__ import annotations

import csv
import io
import itertools
import re
from collections.abc import Sequence

from drivebus.cli.manual_cells import (
    TableRow,
    count_of,
    default_of,
    is_code,
    place_of,
    place_of_code,
    take_choices,
    take_range,
    take_step,
)
from drivebus.cli.pasted_table import as_sheet
from drivebus.cli.wrong_use import WrongUse
from drivebus.record.sheets import read_sheet

__all__ = ["ManualTable", "NoAddresses"]

_TITLES = {
    "address": r".*\baddr(ess|\.)?\b.*|register|reg\.?|location",
    "code": r"(function |parameter |param\.? |par\.? )?(code|no\.?|number|id\.?)|par\.?|pr\.?",
    "label": r"(function |parameter |register )?(name|description|definition)|function|meaning|item|designation"
    r"|contents?|parameter|explanation|data",
    "unit": r"units?( ?[/,] ?\w+)?",
    "signed": r"sign(ed)?",
    "step": r"resolution|step|increment|precision|accuracy|min(\.|imum)? unit|(one |per )?counts?",
    "scale": r"scale|scaling",
    "range": r".*\brange\b.*|limits",
    "choices": r"options?|choices|values?|settings?|set(ting)? values?",
    "default": r"(factory |initial )?(default|setting|value)( value)?|factory( default)?( setting)?"
    r"|fact\.?|(ex[ -]?)?works",
    "low": r"min(\.|imum)?|low(est)?|from",
    "high": r"max(\.|imum)?|high(est)?|(up )?to",
    "access": r"r/?w|read/write|access|acc\.?|attributes?|property|change(s|d|able)?( .*)?|modif(\.|y|ication)?( .*)?"
    r"|edit(able)?",
    "says": r"remarks?|comments?|notes?",
}
_ACCESS = {
    "ro": r"r|ro|read( ?only)?|r only",
    "wo": r"w|wo|write( ?only)?|w only",
    "rw": r"rw|r/w|wr|w/r|read ?/ ?write|read and write",
}
_ACCESS_OF_PARAMETERS = {
    "ro": _ACCESS["ro"],
    "wo": _ACCESS["wo"],
    "run": r"run|any ?time|always|(while |when |during |in )(running|operation|run)|run(ning)? ?(and|or|/) ?stop(ped)?",
    "stop": r"stop(ped)?|(only )?(while |when |at |during |in )(stop(ped)?|standstill|rest)",
}
"""Of a parameter, that it can be written does not tell whether also while the motor turns."""
_REGISTERS = "address,table,name,label,unit,scale,signed,low,high,high_from,variant,access,verified,note,source"
_PARAMETERS = (
    "code,address,name,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source"
)


class NoAddresses(WrongUse):
    """A table has codes of parameters, and no addresses."""


class ManualTable:
    """What the tables of a manual say, one after the other.

    Attributes:
        rows: What could be read.
        left_out: The line of each row of the last table that could not, and why.
        unused: The titles of the columns of the last table of which nothing was taken.
    """

    def __init__(self) -> None:
        self.rows: list[TableRow] = []
        self.left_out: list[tuple[int, str]] = []
        self.unused: list[str] = []
        self._names: dict[str, int] = {}
        self._before: tuple[int, dict[str, int]] = (0, {})

    def read(self, data: bytes, source: str, *, count: str | None = None) -> list[TableRow]:
        """Adds the rows of a table; says which these are.

        *data* is as a spreadsheet saves it, or pasted; *source* is where it is printed; *count* is how its addresses
        are written, if they do not tell.

        Raises:
            WrongUse: It has no column of addresses or of names, or its addresses may mean two things. No row was
                added. `NoAddresses`: only the codes of parameters.
            NotAllowed: It is no such text.
        """
        data = as_sheet(data)
        titles, rows = read_sheet(data, titles_of(data))
        places = _columns(titles, by_code=count == "group.index")
        used = set(places.values())
        self.unused = [title for place, title in enumerate(titles) if title and place not in used]
        cells = [(line, _cells(row, places)) for line, row in rows]
        count = count or count_of(titles[places["address"]], [row["address"] for _, row in cells])
        by_code = count == "group.index"
        said = "code" if by_code else "address"
        taken = {(row.table, row.address): row.name for row in self.rows}
        self.left_out, before = [], len(self.rows)
        self._before = before, dict(self._names)
        for line, row in cells:
            place = place_of_code(row["code"]) if by_code else place_of(row["address"], count)
            if place is None:
                self.left_out.append((line, f'"{row[said]}" is no {said} of one register'))
            elif not row["label"]:
                self.left_out.append((line, "it has no name"))
            elif place in taken:
                self.left_out.append((line, f"its address is that of {taken[place]}"))
            else:
                taken[place] = f"line {line}"
                self.rows.append(self._row(line, place, row, source))
        return self.rows[before:]

    def take_back(self) -> None:
        """Takes the rows of the last table away again, and their names."""
        count, self._names = self._before
        del self.rows[count:]

    def called(self, text: str) -> TableRow | None:
        """The row of which *text* is the code, the name or the label; None where several have that label, or none."""
        called = " ".join(text.lower().split())
        own = next((row for row in self.rows if called in {row.code.lower(), row.name}), None) if called else None
        labelled = [row for row in self.rows if row.label.lower() == called]
        return own or (labelled[0] if len(labelled) == 1 else None)

    def at(self, address: int, table: str = "holding") -> TableRow | None:
        """The row at *address*."""
        return next((row for row in self.rows if (row.table, row.address) == (table, address)), None)

    def add(self, address: int, label: str, source: str) -> TableRow:
        """Adds a holding register that no table has."""
        row = TableRow(0, address, "holding", self._name(label), label, source=source)
        self.rows.append(row)
        return row

    def _row(self, line: int, place: tuple[str, int], cells: dict[str, str], source: str) -> TableRow:
        table, address = place
        row = TableRow(line, address, table, self._name(cells["label"]), cells["label"], source=source)
        if table == "holding" and is_code(cells.get("code", "")):
            row.code = cells["code"]
        if row.code and take_choices(row, cells):
            row.scale = 1
        else:
            take_step(row, cells)
            take_range(row, cells)
        row.signed = row.signed or cells.get("signed", "").lower() in {"yes", "y", "signed", "1", "x"}
        known = _ACCESS_OF_PARAMETERS if row.code else _ACCESS
        said = cells.get("access", "").lower()
        row.access = next((access for access, words in known.items() if re.fullmatch(words, said)), "unknown")
        if table == "input":
            row.access = "ro"
        if row.code and row.scale is not None:
            row.default = default_of(cells)
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

    @property
    def registers(self) -> list[TableRow]:
        """The rows without a code."""
        return [row for row in self.rows if not row.code]

    @property
    def parameters(self) -> list[TableRow]:
        """The rows with one."""
        return [row for row in self.rows if row.code]

    def give_up(self, row: TableRow, reason: str) -> None:
        """What *row* says cannot be: factory value, choices or range goes into its note; at last the row goes."""
        if row.default:
            row.notes.append(f"the table has the factory value {row.default}")
            row.default = ""
        elif row.choices:
            said = ", ".join(f"{number}: {label}" for number, label in row.choices.items())
            row.notes.append(f"the table has {said}")
            row.choices = {}
        elif row.low or row.high or row.high_from:
            row.without_range()
        else:
            self.rows.remove(row)
            self.left_out.append((row.line, reason))

    def csv(self) -> dict[str, str]:
        """The rows as `registers.csv` and `parameters.csv` have them."""
        registers, parameters = [_REGISTERS.split(",")], [_PARAMETERS.split(",")]
        for row in self.rows:
            signed = "yes" if row.signed or row.low.startswith("-") else "no"
            scale = "" if row.scale is None else str(row.scale)
            at = f"0x{row.address:04X}"
            facts = [row.name, row.label, row.unit, scale, signed, row.low]
            proof = ["yes", row.note, row.source]
            if row.code:
                choices = ";".join(f"{number}={label}" for number, label in row.choices.items())
                parameters.append(
                    [row.code, at, *facts, "", row.high, row.high_from, row.default, row.access, choices, *proof]
                )
            else:
                registers.append([at, row.table, *facts, row.high, row.high_from, row.variant, row.access, *proof])
        return {"registers.csv": _as_text(registers), "parameters.csv": _as_text(parameters)}


def _cells(row: Sequence[str], places: dict[str, int]) -> dict[str, str]:
    """What stands in *row*, by what the column at each of *places* says."""
    return {what: " ".join(row[place].split()) if place < len(row) else "" for what, place in places.items()}


def _as_text(rows: list[list[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def titles_of(data: bytes) -> list[str]:
    """What the titles of a table may be, whatever divides its cells: no number in these columns is turned around."""
    encoding = "utf-16" if data[:2] in {b"\xff\xfe", b"\xfe\xff"} else "utf-8-sig"
    first = next((line for line in data.decode(encoding, "replace").splitlines() if line.strip(",;\t ")), "")
    return [title.strip() for divider in ",;\t" for title in next(csv.reader([first], delimiter=divider), [])]


def _columns(titles: Sequence[str], *, by_code: bool) -> dict[str, int]:
    """In which column each thing stands, the first of several; *by_code* says that no address is needed."""
    places: dict[str, int] = {}
    for place, title in enumerate(titles):
        plain = " ".join(re.sub(r"\(.*?\)", " ", title.lower()).split())
        what = next((what for what, words in _TITLES.items() if re.fullmatch(words, plain)), None)
        if what == "label" and what in places:
            what = "says"
        if what is not None:
            places.setdefault(what, place)
    needed = ("code", "a code") if by_code else ("address", "an address")
    for what, wanted in (needed, ("label", "a name")):
        if what in places:
            continue
        joined = next((title for title in titles if _is_joined(title)), None)
        if joined is not None:
            raise WrongUse(f'"{joined}" may be two columns: divide titles by two blanks, as their cells are')
        if what == "address" and "code" in places:
            raise NoAddresses(
                "no column of the table is an address. Where the manual says that the code of a parameter tells it, "
                "P05.06 is at 0506H, give --addresses group.index"
            )
        raise WrongUse(
            f"no column of the table is {wanted}: its first line has {', '.join(map(repr, titles)) or 'nothing'}. "
            "Call the columns code, address, name, unit, scale, range, default and access; only address and name are "
            "needed"
        )
    return places


def _is_joined(title: str) -> bool:
    """Whether *title* is several words, each of them a title, and one that of the addresses."""
    words = title.lower().split()
    known = [next((what for what, named in _TITLES.items() if re.fullmatch(named, word)), None) for word in words]
    return len(words) > 1 and None not in known and "address" in known
