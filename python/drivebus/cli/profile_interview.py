"""The questions of `drivebus profiles new`: what a manual says of a drive, one thing at a time.

Nothing is guessed: what the manual does not print is left out by Enter, and what may mean two things is asked again.
"""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.drive_beside import DriveBeside, WordReader
from drivebus.cli.interview_commands import CommandQuestions
from drivebus.cli.interview_parameters import ParameterQuestions
from drivebus.cli.interview_registers import FAULT, FREQUENCY, RegisterQuestions
from drivebus.cli.interview_speed import SpeedQuestions
from drivebus.cli.interview_state import StateQuestions
from drivebus.cli.interview_tables import Pages, TableQuestions, content
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.profile_answers import Answers
from drivebus.cli.wrong_use import WrongUse

__all__ = ["ask"]

T = TypeVar("T")


def ask(table: Path | None, source: str | None, count: str | None, reader: WordReader | None) -> Answers:
    """Asks who has the manual; *table* and *source* are of a first table, *count* is how addresses are written.

    *reader* is of the drive, if that is there: what it shows is held against the answers.

    Raises:
        click.Abort: The input ended, or Ctrl-C was pressed.
        WrongUse: *table* cannot be read.
    """
    dialogue = Dialogue()

    def asked() -> Answers:
        dialogue.say(
            "The manual's chapter on Modbus answers what follows. Enter leaves out what it does not print; "
            "back takes the last answer back."
        )
        title = dialogue.needed("Maker and series, as the drive's plate has them", values.plain)
        manual = dialogue.needed("The manual: title or number, edition", values.plain)
        interview = _Interview(dialogue, manual, reader)
        if table is not None and source is not None:
            interview.tables.take(table.read_bytes(), source, count)
        interview.tables.take_tables(count)
        answers = Answers(title, manual, interview.table)
        interview.fill(answers)
        return answers

    return dialogue.held(asked)


class _Interview:
    """The questions that go on from what was answered before: pages, and the rows of tables."""

    def __init__(self, dialogue: Dialogue, manual: str, reader: WordReader | None) -> None:
        self._dialogue = dialogue
        self._pages = Pages(dialogue, manual)
        self.table = ManualTable()
        beside = DriveBeside(dialogue, self.table, reader)
        self.tables = TableQuestions(dialogue, self._pages, self.table, beside)
        self._parameters = ParameterQuestions(dialogue, self._pages, self.table, beside)
        self._registers = RegisterQuestions(dialogue, self._pages, self.table, beside)
        self._speed = SpeedQuestions(dialogue, self._pages, self._registers, self._parameters)
        self._commands = CommandQuestions(dialogue, self._pages, self._registers)
        self._state = StateQuestions(dialogue, self._pages, self._registers)

    def fill(self, answers: Answers) -> None:
        """Asks for all that makes the drive known by name."""
        answers.commands = self._commands.commands()
        self._speed.fill(answers)
        answers.state = self._state.state()
        answers.frequency = self._frequency(answers)
        answers.fault = self._registers.named(FAULT)
        if answers.fault is not None and answers.fault.scale is None:
            answers.fault.scale = 1
        answers.control.extend(self._parameters.control())
        answers.ramp = self._parameters.ramp()
        answers.watchdog = self._parameters.watchdog()
        self._parameters.take_access()
        if answers.fault is not None:
            question = "File with the numbers of the faults, 1 OC overcurrent (- to paste; Enter: none)"
            answers.faults = self._dialogue.optional(question, self._faults) or []
            answers.faults_source = self._pages.source() if answers.faults else ""
        answers.writes = self._dialogue.needed("Functions that write words: 6, 16, or both", values.functions, "6")
        most = "Most words in one request; 1 is never wrong"
        answers.max_words = self._dialogue.needed(most, _most_words, "1")
        answers.requests_source = self._pages.source() if answers.max_words > 1 or answers.writes != [6] else ""
        factory = "The line as it leaves the factory: speed, format, unit, such as 9600 8N1 1"
        line = self._dialogue.optional(factory, values.line)
        if line is not None:
            answers.serial = (*line, self._pages.source())

    def _frequency(self, answers: Answers) -> TableRow | None:
        """What tells the output frequency; with a sign, if it has one in reverse and no table says so."""
        row = self._registers.named(FREQUENCY)
        if row is None or not self._parameters.counts(row, "Hz", "it"):
            return None
        turns_back = answers.commands is None or "run_reverse" in answers.commands.words
        if turns_back and not row.signed and not row.low:
            row.signed = self._dialogue.agreed("Is it below zero while the motor turns in reverse?", default=None)
        return row

    def _faults(self, text: str) -> list[tuple[int, str, str]]:
        found = values.faults(content(self._dialogue, text))
        said = ", ".join(" ".join(filter(None, (str(number), code, label))) for number, code, label in found)
        self._dialogue.say(f"Faults: {said}.")
        return found


def _most_words(text: str) -> int:
    count = values.word(text.strip())
    if not 1 <= count <= 125:
        raise WrongUse(f"{count} is not in the range from 1 to 125")
    return count
