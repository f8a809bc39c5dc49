"""The questions for registers: which one it is, and what it must allow."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.drive_beside import DriveBeside
from drivebus.cli.interview_tables import Pages
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.row_kinds import against
from drivebus.cli.wrong_use import WrongUse

__all__ = ["COMMAND", "FAULT", "FREQUENCY", "SETPOINT", "STATE", "RegisterQuestions", "allow", "insist", "widen"]


class Role(NamedTuple):
    """What a register is asked for.

    Attributes:
        question: What it is, as it is asked.
        kind: What its name may say, as `row_kinds` has it.
        label: What one is called that no table has.
        access: How it is taken where its table does not tell.
        units: What it may count in.
    """

    question: str
    kind: str
    label: str
    access: str
    units: frozenset[str] = frozenset()


COMMAND = Role("Register that takes run and stop", "command", "Command to the motor", "wo")
SETPOINT = Role("Register that takes the speed", "setpoint", "Speed setpoint", "rw", frozenset({"Hz", "%", "rpm"}))
STATE = Role("Register that tells what the motor does", "state", "What the motor does", "ro")
FREQUENCY = Role("Register that tells the output frequency", "speed", "Output frequency", "ro", frozenset({"Hz"}))
FAULT = Role("Register that tells the number of a fault", "fault", "Fault", "ro")


class RegisterQuestions:
    """Asks for rows of *table*, and adds to it what it has not. The drive that is *beside* should have them."""

    def __init__(self, dialogue: Dialogue, pages: Pages, table: ManualTable, beside: DriveBeside) -> None:
        self.table = table
        self.beside = beside
        self._dialogue = dialogue
        self._pages = pages
        self._used: list[TableRow] = []

    def named(self, role: Role) -> TableRow | None:
        """The row that is named by its name or address; one that no table has is made."""
        question = f"{role.question}: name or address, such as 2000H"
        found = self._dialogue.optional(question, lambda text: self._free(text, role))
        if found is None:
            return None
        row = self.table.add(found, role.label, self._pages.source()) if isinstance(found, int) else found
        self._used.append(row)
        if row.access == "unknown":
            row.access = role.access
        if row.access == "rw" and row.place in self.beside.refused:
            row.access = "wo"
        if row.unit and row.unit not in role.units:
            row.without_unit()
        return row

    def _free(self, text: str, role: Role) -> TableRow | int:
        found = self._known_or_place(text)
        if any(found is row for row in self._used):
            raise WrongUse(f"{text} is the register of another answer")
        if isinstance(found, TableRow):
            insist(self._dialogue, found, role.question, role.kind, role.units)
        if role is not COMMAND:
            self._compare(role, found)
        return found

    def _compare(self, role: Role, found: TableRow | int) -> None:
        """Holds what the drive shows there now against what it should be."""
        if isinstance(found, TableRow):
            place, word = found.place, self.beside.check(found)
        else:
            place, word = found, self.beside.check_place(found)
        if role is FREQUENCY:
            self.beside.check_speed(place, word)
        elif role is FAULT:
            self.beside.check_fault(place, word)

    def _known_or_place(self, text: str) -> TableRow | int:
        row = self.table.called(text)
        if row is not None:
            return row
        table, address = values.place(text)
        row = self.table.at(address, table)
        if row is None and table != "holding":
            raise WrongUse(f'no table has "{text}", which is an input register')
        return address if row is None else row


def insist(dialogue: Dialogue, row: TableRow, question: str, kind: str, units: Collection[str]) -> None:
    """Asks whether *row* is meant, where its name or its unit says that it is something else.

    Raises:
        WrongUse: It is not.
    """
    told = against(row, kind, units)
    if told is not None:
        what = f"{question[0].lower()}{question[1:]}"
        dialogue.insisted(
            f"{told}. Is it the {what} all the same?", f"then {row.code or row.name} is not what was asked"
        )


def allow(row: TableRow, access: str) -> None:
    """That *row* can be written, whatever its table says of it."""
    if row.access in {"ro", "unknown"}:
        if row.access == "ro":
            row.notes.append("the table says that it is read only")
        row.access = access


def widen(row: TableRow, words: list[int]) -> None:
    """The words of commands are whole numbers; a range of the table that is without them goes to the note."""
    row.unit, row.scale = "", 1
    if (row.low or row.high) and not all(float(row.low or 0) <= word <= float(row.high or 0xFFFF) for word in words):
        row.without_range()
