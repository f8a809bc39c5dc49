"""The drive that is there while its manual is read: what it shows is held against each answer at once.

It is only read, a word at a time. What speaks against an answer is insisted on, or the question is asked again.
"""

from __future__ import annotations

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

    Attributes:
        state: What the motor does, once its register is known: a name of `profile_answers.State`.
    """

    def __init__(self, dialogue: Dialogue, table: ManualTable, reader: WordReader | None) -> None:
        self.state = ""
        self._dialogue = dialogue
        self._table = table
        self._reader = reader

    def word(self, place: int) -> int | None:
        """What is at *place* now; None where nobody tells."""
        return self._look(place).value

    def check_place(self, place: int) -> int | None:
        """What is at *place*; asks whether a place is meant that the drive refuses.

        Raises:
            WrongUse: It is not.
        """
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
            self.check_step(row, word, row.unit, row.scale)
        return word

    def check_now(self, row: TableRow, unit: str, scale: int) -> None:
        """Whether *row* may be what it is now, with so many counts in one *unit*.

        Raises:
            WrongUse: It may not.
        """
        word = None if row.access == "wo" else self.word(row.place)
        if word is not None:
            self.check_step(row, word, unit, scale)

    def check_step(self, row: TableRow, word: int, unit: str, scale: int) -> None:
        """As `check_now`, for the *word* that is there."""
        low, high = self._range(row)
        is_signed = row.signed or low.startswith("-")
        word -= 0x10000 if is_signed and word > 0x7FFF else 0
        value = word / scale
        now = f"{_now(row, word, scale)} {unit} now"
        if not float(low or "-inf") <= value <= float(high or "inf"):
            self._doubt(f"{now}, and its table has {low} to {high}", now)
        elif unit == "Hz" and value > _MOST_HERTZ:
            self._doubt(f"{now}, which no drive is", now)
        else:
            self._dialogue.say(f"{now}.")

    def check_ends(self, row: TableRow, low: float, high: float) -> None:
        """Whether *row*, whose step is known, is between *low* and *high* now.

        Raises:
            WrongUse: It is not.
        """
        word = self.word(row.place)
        if word is not None and row.scale is not None and not low <= word / row.scale <= high:
            now = f"{_now(row, word, row.scale)} {row.unit} now"
            self._doubt(f"{now}, and it is to be from {low:g} to {high:g}", now)

    def check_speed(self, place: int, word: int | None) -> None:
        """Whether an output frequency of *word* counts fits what the motor does.

        Raises:
            WrongUse: It does not.
        """
        shown = tables.shown(place)
        if word and self.state == "stopped":
            self._doubt(f"{shown} has {word} now, and the motor stands still", f"{shown} is no output frequency")
        elif word == 0 and self.state in {"forward", "reverse", "running"}:
            self._doubt(f"{shown} has 0 now, and the motor runs", f"{shown} is no output frequency")

    def check_fault(self, place: int, word: int | None) -> None:
        """Whether *word* may be the number of the fault that there is, if there is one.

        Raises:
            WrongUse: It may not.
        """
        shown = tables.shown(place)
        if word == 0 and self.state == "fault":
            self._doubt(f"{shown} has 0 now, and the drive has a fault", f"{shown} is no number of it")
        elif word is not None:
            self._dialogue.say(f"{shown} has {word} now.")

    def check_share(self, row: TableRow, counts: int) -> None:
        """Whether *row* may be what it is now, where *counts* are 100 % of it.

        Raises:
            WrongUse: It may not.
        """
        word = None if row.access == "wo" else self.word(row.place)
        if word is not None and min(word, 0x10000 - word) > counts:
            self._doubt(f"{row.name} is {word} now, which is more than {counts}", f"{row.name} is {word} now")

    def _check_choice(self, row: TableRow, word: int) -> None:
        now = f"{row.code or row.name} is {word} now"
        if word in row.choices:
            self._dialogue.say(f"{now}: {row.choices[word]}.")
        else:
            self._doubt(f"{now}, which its table has not", now)

    def _range(self, row: TableRow) -> tuple[str, str]:
        """The lowest and the highest value; empty where that is not known."""
        if row.printed is not None and not row.low:
            return row.printed.low, row.printed.high
        limit = self._table.called(row.high_from) if row.high_from else None
        return row.low, row.high if limit is None else limit.high

    def _doubt(self, told: str, else_said: str) -> None:
        self._dialogue.insisted(f"{told}. Is it right all the same?", else_said)

    def _look(self, place: int) -> Word:
        reader = self._reader
        return Word() if reader is None else self._dialogue.seen(lambda: reader.read(place))


def _now(row: TableRow, word: int, scale: int) -> str:
    """What *row* is, with as many decimals as the step has."""
    return f"{row.code or row.name} is {word / scale:.{len(str(scale)) - 1}f}"
