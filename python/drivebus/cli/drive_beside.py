"""The drive that is there while its manual is read: what it shows is held against each answer at once.

It is only read, a word at a time. What speaks against an answer is insisted on, or the question is asked again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import drivebus
from drivebus import tables
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import remark

__all__ = ["DriveBeside", "WordReader"]

_MOST_HERTZ = 4000
"""No drive of these turns a motor faster: the step is wrong, or the register."""
_MOST_ROWS = 40
"""So many rows of a table are read at once: some two seconds on a slow line."""


class Word(NamedTuple):
    """What came of a read: a word, or by what it was refused; neither where nobody answered."""

    value: int | None = None
    refusal: str = ""


class WordReader:
    """Reads words of one unit of a bus, until that does not answer: this is told once."""

    def __init__(self, bus: drivebus.Bus, unit: int, called: str) -> None:
        self.called = called
        self.is_silent = False
        self._bus = bus
        self._unit = unit

    def read(self, place: int) -> Word:
        """What is at *place*."""
        if self.is_silent:
            return Word()
        table, address = tables.split(place)
        try:
            return Word(self._bus.read(self._unit, address, table=table)[0])
        except drivebus.Refused as error:
            return Word(refusal=f"{error.code:02X}H, {error.name.replace('_', ' ')}")
        except drivebus.DrivebusError as error:
            self.fall_silent(error)
            return Word()

    def fall_silent(self, error: drivebus.DrivebusError) -> None:
        """Says that nothing is read any more, and why."""
        self.is_silent = True
        later = "`drivebus profiles check --read` compares it later"
        remark(f"{in_commands(error)}. What you answer is not compared with the drive now; {later}.")


class DriveBeside:
    """What the drive shows, beside what is answered of it; nothing, where it is not there.

    What may not be is insisted on: each check raises `WrongUse` where it is not meant.

    Attributes:
        state: What the motor does, once its register is known: a name of `profile_answers.State`.
        refused: The places that it refused to tell.
    """

    def __init__(self, dialogue: Dialogue, table: ManualTable, reader: WordReader | None) -> None:
        self.state = ""
        self.refused: set[int] = set()
        self._dialogue = dialogue
        self._table = table
        self._reader = reader

    def word(self, place: int) -> int | None:
        """What is at *place* now; None where nobody tells."""
        return self._look(place).value

    def against_table(self, rows: Sequence[TableRow]) -> str:
        """Says what the first *rows* of a table are now. What speaks against them is returned; empty for nothing."""
        if self._reader is None:
            return ""
        shown, doubts, refused, unsure = list[str](), list[str](), list[str](), list[str]()
        for row in [row for row in rows if row.access != "wo"][:_MOST_ROWS]:
            found = self._look(row.place)
            if found.refusal:
                # Nobody says of a row of unknown access that it can be read.
                (unsure if row.access == "unknown" else refused).append(f"{_called(row)} at {row.shown}")
            elif found.value is not None and row.unit and row.scale is not None:
                value = _valued(row, found.value, row.unit, row.scale)
                doubt = self._doubt_of(row, found.value, row.unit, row.scale)
                if doubt:
                    doubts.append(f"{_called(row)} is {value} now, {doubt}")
                else:
                    shown.append(f"{_called(row)} {value}")
        called = self._reader.called
        if shown:
            self._dialogue.say(f"{called} shows {', '.join(shown)}.")
        if unsure:
            self._dialogue.say(f"{called} refuses {', '.join(unsure)}.")
        return "; ".join([*([f"{called} refuses {', '.join(refused)}"] if refused else []), *doubts])

    def check_place(self, place: int) -> int | None:
        """What is at *place*; asks whether a place is meant that the drive refuses."""
        found = self._look(place)
        if found.refusal and self._reader is not None:
            shown = tables.shown(place)
            told = f"{self._reader.called} refuses {shown} ({found.refusal}): it has nothing to read there"
            self._dialogue.insisted(f"{told}, or the address is one off. Is it {shown} all the same?", told)
        return found.value

    def check(self, row: TableRow) -> int | None:
        """As `check_place`, and whether what is there may be, as far as the table of *row* tells."""
        if row.access == "wo":
            return None
        word = self.check_place(row.place)
        if word is None:
            return None
        if row.choices:
            self._check_choice(row, word)
        elif row.scale is not None and row.unit:
            self._check_value(row, word, row.unit, row.scale)
        return word

    def check_step(self, row: TableRow, unit: str, scale: int) -> None:
        """Whether *row* may be what it is now, with so many counts in one *unit*."""
        word = None if row.access == "wo" else self.word(row.place)
        if word is not None:
            self._check_value(row, word, unit, scale)

    def check_ends(self, row: TableRow, low: float, high: float) -> None:
        """Whether *row*, whose step is known, is between *low* and *high* now."""
        word = self.word(row.place)
        if word is not None and row.scale is not None and not low <= _counts(row, word) / row.scale <= high:
            now = f"{_called(row)} is {_valued(row, word, row.unit, row.scale)} now"
            self._insist(now, f"and it is to be from {low:g} to {high:g}")

    def check_share(self, row: TableRow, counts: int) -> None:
        """Whether *row* may be what it is now, where *counts* are 100 % of it."""
        word = None if row.access == "wo" else self.word(row.place)
        if word is not None and min(word, 0x10000 - word) > counts:
            self._insist(f"{_called(row)} is {word} now", f"which is more than {counts}")

    def check_speed(self, place: int, word: int | None) -> None:
        """Whether an output frequency of *word* counts fits what the motor does."""
        if word and self.state == "stopped":
            self._insist(f"{tables.shown(place)} has {word} now", "and the motor stands still")
        elif word == 0 and self.state in {"forward", "reverse", "running"}:
            self._insist(f"{tables.shown(place)} has 0 now", "and the motor runs")

    def check_fault(self, place: int, word: int | None) -> None:
        """Whether *word* may be the number of the fault that there is, if there is one."""
        if word == 0 and self.state == "fault":
            self._insist(f"{tables.shown(place)} has 0 now", "and the drive has a fault")
        elif word is not None:
            self._dialogue.say(f"{tables.shown(place)} has {word} now.")

    def _check_choice(self, row: TableRow, word: int) -> None:
        now = f"{_called(row)} is {word} now"
        if word in row.choices:
            self._dialogue.say(f"{now}: {row.choices[word]}.")
        else:
            self._insist(now, "which its table has not")

    def _check_value(self, row: TableRow, word: int, unit: str, scale: int) -> None:
        now = f"{_called(row)} is {_valued(row, word, unit, scale)} now"
        doubt = self._doubt_of(row, word, unit, scale)
        if doubt:
            self._insist(now, doubt)
        else:
            self._dialogue.say(f"{now}.")

    def _doubt_of(self, row: TableRow, word: int, unit: str, scale: int) -> str:
        """What speaks against *word* in a row of such a step; empty where that may be."""
        low, high = self._range(row)
        value = _counts(row, word) / scale
        if not float(low or "-inf") <= value <= float(high or "inf"):
            return f"and its table has {low} to {high}"
        return "which no drive is" if unit == "Hz" and value > _MOST_HERTZ else ""

    def _range(self, row: TableRow) -> tuple[str, str]:
        """The lowest and the highest value; empty where that is not known."""
        if row.printed is not None and not row.low:
            return row.printed.low, row.printed.high
        limit = self._table.called(row.high_from) if row.high_from else None
        return row.low, row.high if limit is None else limit.high

    def _insist(self, now: str, doubt: str) -> None:
        self._dialogue.insisted(f"{now}, {doubt}. Is it right all the same?", now)

    def _look(self, place: int) -> Word:
        reader = self._reader
        found = Word() if reader is None else self._dialogue.seen(lambda: reader.read(place))
        if found.refusal:
            self.refused.add(place)
        return found


def _called(row: TableRow) -> str:
    return row.code or row.name


def _counts(row: TableRow, word: int) -> int:
    """*word* as a number, below zero where the table has such."""
    is_signed = row.signed or row.low.startswith("-") or (row.printed is not None and row.printed.low.startswith("-"))
    return word - 0x10000 if is_signed and word > 0x7FFF else word


def _valued(row: TableRow, word: int, unit: str, scale: int) -> str:
    """What *word* is in *unit*, with as many decimals as the step has."""
    return f"{_counts(row, word) / scale:.{len(str(scale)) - 1}f} {unit}"
