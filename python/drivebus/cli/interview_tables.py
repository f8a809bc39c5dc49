"""The tables of a manual, one after the other: what is taken of each, and what is asked where it means two things."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path

import drivebus
from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.drive_beside import DriveBeside
from drivebus.cli.manual_cells import COUNTS, TableRow, UnclearAddresses
from drivebus.cli.manual_table import ManualTable, NoAddresses
from drivebus.cli.wrong_use import WrongUse

__all__ = ["Pages", "TableQuestions", "content", "one_of"]

_SAME = "same"


class Pages:
    """Where a manual prints what is answered. No page is taken by Enter; the one before has a word."""

    def __init__(self, dialogue: Dialogue, manual: str) -> None:
        self._dialogue = dialogue
        self._manual = manual
        self._page = ""

    def source_of(self, row: TableRow, *, is_printed: bool) -> str:
        """Where the words of a register are printed; *is_printed* says that its own row does.

        One that no table has was just asked for its page.
        """
        return row.source if is_printed or not row.line else self.source(f"Page that says what {row.name} means")

    def source(self, question: str = "Its page") -> str:
        """Document and page."""
        same = f" ({_SAME}: {self._page})" if self._page else ""
        self._page = self._dialogue.needed(f"{question}{same}", self._read)
        return f"{self._manual}, {f'p. {self._page}' if self._page.isdecimal() else self._page}"

    def _read(self, text: str) -> str:
        page = values.plain(text)
        if page.lower() != _SAME:
            # `41`, `B-12`, `chapter 4`, and what stands before page 1 of a book.
            if re.search(r"\d", page) or re.fullmatch("[ivxl]+", page):
                return page
            raise WrongUse(f'"{page}" is no page: it has no number')
        if not self._page:
            raise WrongUse(f'"{_SAME}" is the page before, and there is none')
        return self._page


class TableQuestions:
    """The tables that are given.

    Attributes:
        table: The rows of all of them.
    """

    def __init__(self, dialogue: Dialogue, pages: Pages, table: ManualTable, beside: DriveBeside) -> None:
        self.table = table
        self._dialogue = dialogue
        self._pages = pages
        self._beside = beside

    def take_tables(self, count: str | None) -> None:
        """Tables of the manual, until there are no more."""
        self._dialogue.say(
            "Tables of registers or parameters spare you typing: CSV, or text as pasted, its line of titles first."
        )
        question = "File with a table (- to paste one; Enter: no more)"
        while (found := self._dialogue.optional(question, lambda text: content(self._dialogue, text))) is not None:
            try:
                self.take(found.encode(), self._pages.source(), count)
            except (drivebus.NotAllowed, WrongUse) as error:
                self._dialogue.say(f"Error: {error}")

    def take(self, data: bytes, source: str, count: str | None) -> None:
        """Adds a table, and says what was left out of it."""
        rows = self._read(data, source, count)
        for line, why in sorted(self.table.left_out):
            self._dialogue.say(f"line {line} is left out: {why}")
        if self.table.unused:
            self._dialogue.say(
                f"Nothing is taken from the columns {', '.join(map(repr, self.table.unused))}. If it should be, type "
                "back twice, and call them code, name, unit, step, signed, range, low, high, choices, default or "
                "access."
            )
        self._take_decimals(rows)
        self._take_units(rows)
        for row in rows:
            if row.note:
                self._dialogue.say(f"line {row.line}, {row.code or row.name}, goes into a note: {row.note}")
        registers, parameters = [row for row in rows if not row.code], [row for row in rows if row.code]
        for kind, found in (("Registers", registers), ("Parameters", parameters)):
            if found:
                self._dialogue.say(f"{kind}: {', '.join(f'{row.code or row.name} at {row.shown}' for row in found)}.")
        against = self._beside.against_table([*registers, *parameters])
        if against and not self._dialogue.agreed(f"{against}. Is the table right all the same?", default=False):
            self.table.take_back()
            self._dialogue.say("Then it is left out: give it once more, its addresses or steps as the drive has them.")

    def _read(self, data: bytes, source: str, count: str | None) -> list[TableRow]:
        """The rows of a table, whose addresses may have to be asked for."""
        try:
            return self.table.read(data, source, count=count)
        except UnclearAddresses:
            count = self._dialogue.needed("Its addresses are hex, decimal or 40001", one_of(COUNTS[:3]))
        except NoAddresses:
            if not self._dialogue.agreed(
                "Does the code of a parameter tell its address, P05.06 at 0506H?", default=False
            ):
                raise
            count = "group.index"
        return self.table.read(data, source, count=count)

    def _take_decimals(self, rows: list[TableRow]) -> None:
        """The steps of ranges that are printed without one, if their decimals tell."""
        printed = [row for row in rows if row.printed is not None]
        if not printed:
            return
        low, high, unit, _ = printed[0].printed or ("", "", "", "")
        first = f"{printed[0].code or printed[0].name}: {low} to {high} {unit}".rstrip()
        if self._dialogue.agreed(f"Is one count the last decimal that a range has ({first})?", default=False):
            for row in printed:
                row.by_decimals()

    def _take_units(self, rows: list[TableRow]) -> None:
        """The steps of rows that have a unit and none, if each counts whole ones."""
        whole = [row for row in rows if row.unit and row.scale is None and not row.untaken]
        if not whole:
            return
        first = ", ".join(f"{row.code or row.name} in {row.unit}" for row in whole)
        if self._dialogue.agreed(f"No step is printed of {first}. Is one count of each 1?", default=False):
            for row in whole:
                row.scale = 1


def content(dialogue: Dialogue, text: str) -> str:
    """What is in a file, or is pasted."""
    if text == "-":
        return dialogue.pasted()
    try:
        return Path(text).read_bytes().decode("utf-8-sig", "replace")
    except OSError as error:
        raise WrongUse(f"{text}: {error.strerror or error}") from error


def one_of(choices: Iterable[str]) -> Callable[[str], str]:
    """What takes one of *choices*."""
    known = list(choices)

    def read(text: str) -> str:
        if text.strip() not in known:
            raise WrongUse(f'"{text.strip()}" is not one of {", ".join(known)}')
        return text.strip()

    return read
