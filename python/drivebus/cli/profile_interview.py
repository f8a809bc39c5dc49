"""The questions of `drivebus profiles new`: what a manual says of a drive, one thing at a time.

Nothing is guessed: what the manual does not print is left out by Enter, and what may mean two things is asked again.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TypeVar

from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.interview_commands import CommandQuestions
from drivebus.cli.interview_parameters import ParameterQuestions
from drivebus.cli.interview_registers import FAULT, FREQUENCY, SETPOINT, RegisterQuestions, allow
from drivebus.cli.interview_state import StateQuestions
from drivebus.cli.interview_tables import Pages, TableQuestions, content
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.profile_answers import Answers, Share
from drivebus.cli.wrong_use import WrongUse

__all__ = ["ask"]

T = TypeVar("T")


def ask(table: Path | None, source: str | None, count: str | None) -> Answers:
    """Asks who has the manual; *table* and *source* are of a first table, *count* is how addresses are written.

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
        interview = _Interview(dialogue, manual)
        if table is not None and source is not None:
            interview.tables.take(table.read_bytes(), source, count)
        interview.tables.take_tables(count)
        answers = Answers(title, manual, interview.table)
        interview.fill(answers)
        return answers

    return dialogue.held(asked)


class _Interview:
    """The questions that go on from what was answered before: pages, and the rows of tables."""

    def __init__(self, dialogue: Dialogue, manual: str) -> None:
        self._dialogue = dialogue
        self._pages = Pages(dialogue, manual)
        self.tables = TableQuestions(dialogue, self._pages)
        self.table = self.tables.table
        self._parameters = ParameterQuestions(dialogue, self._pages, self.table)
        self._registers = RegisterQuestions(dialogue, self._pages, self.table)
        self._commands = CommandQuestions(dialogue, self._pages, self._registers)
        self._state = StateQuestions(dialogue, self._pages, self._registers)

    def fill(self, answers: Answers) -> None:
        """Asks for all that makes the drive known by name."""
        answers.commands = self._commands.commands()
        answers.setpoint = self._registers.named(SETPOINT)
        if answers.setpoint is not None:
            answers.is_read_back = bool(answers.setpoint.line) and answers.setpoint.access == "rw"
            answers.share = self._take_speed(answers.setpoint)
            if answers.setpoint.scale is None and answers.share is None:
                self._dialogue.say("Then its speed cannot be set by name.")
                answers.setpoint = None
        answers.state = self._state.state()
        answers.frequency = self._registers.named(FREQUENCY)
        if answers.frequency is not None and not self._parameters.counts(answers.frequency, "Hz", "it"):
            answers.frequency = None
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

    def _faults(self, text: str) -> list[tuple[int, str, str]]:
        found = values.faults(content(self._dialogue, text))
        said = ", ".join(" ".join(filter(None, (str(number), code, label))) for number, code, label in found)
        self._dialogue.say(f"Faults: {said}.")
        return found

    def _take_speed(self, row: TableRow) -> Share | None:
        """What a count of the setpoint is. Where it is a share of a frequency, of which."""
        allow(row, "rw")
        if row.unit == "Hz" and row.scale is not None:
            return None
        question = "One count of it is, such as 0.01 Hz; or counts that are a frequency, 10000 = P00.03"
        said = self._dialogue.optional(question, lambda text: self._as_the_table(row, text, values.speed(text)))
        row.scale = None
        if said is None:
            return None
        if isinstance(said, Fraction):
            row.unit, row.scale = "Hz", int(1 / said)
            return None
        counts, of = said
        whole = "100 % is the parameter, such as P00.03"
        code = self._parameters.parameter(of) if of else self._dialogue.needed(whole, self._parameters.parameter)
        if not self._parameters.counts(code, "Hz", code.code):
            return None
        if not (code.low and code.high):
            ends = f"{code.code} may be from and to, in Hz, such as 10 400"
            code.take_range(*(f"{end:g}" for end in self._dialogue.needed(ends, values.two_numbers)))
        low, high = float(code.low), float(code.high)
        if row.low or row.high:
            row.without_range()
        row.unit, row.variant = "", "of_speed"
        return Share(code.code, counts, low, high, self._pages.source())

    def _as_the_table(self, row: TableRow, text: str, said: T) -> T:
        """What was *said* of a count, as *text*; asked once more where the table has a share, and that is none."""
        told = next((note for note in row.notes if "%" in note), None)
        if told is not None and isinstance(said, Fraction):
            self._dialogue.meant(told, text)
        return said


def _most_words(text: str) -> int:
    count = values.word(text.strip())
    if not 1 <= count <= 125:
        raise WrongUse(f"{count} is not in the range from 1 to 125")
    return count
