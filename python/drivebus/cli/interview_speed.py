"""The questions about the speed: which register takes it, and what one count of it is."""

from __future__ import annotations

from fractions import Fraction
from typing import TypeVar

from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.interview_parameters import ParameterQuestions
from drivebus.cli.interview_registers import SETPOINT, RegisterQuestions, allow
from drivebus.cli.interview_tables import Pages
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.profile_answers import Answers, Share

__all__ = ["SpeedQuestions"]

T = TypeVar("T")


class SpeedQuestions:
    """What is asked about the speed."""

    def __init__(
        self, dialogue: Dialogue, pages: Pages, registers: RegisterQuestions, parameters: ParameterQuestions
    ) -> None:
        self._dialogue = dialogue
        self._pages = pages
        self._registers = registers
        self._parameters = parameters

    def fill(self, answers: Answers) -> None:
        """Asks for what takes the speed."""
        row = self._registers.named(SETPOINT)
        if row is None:
            return
        answers.is_read_back = bool(row.line) and row.access == "rw"
        answers.share = self._take_speed(row)
        if row.scale is None and answers.share is None:
            self._dialogue.say("Then its speed cannot be set by name.")
        else:
            answers.setpoint = row

    def _take_speed(self, row: TableRow) -> Share | None:
        """What a count of the setpoint is. Where it is a share of a frequency, of which."""
        allow(row, "rw")
        if row.unit == "Hz" and row.scale is not None:
            return None
        question = "One count of it is, such as 0.01 Hz; or counts that are a frequency, 10000 = P00.03"
        said = self._dialogue.optional(question, lambda text: self._count(row, text))
        row.scale = None
        if said is None:
            return None
        if isinstance(said, Fraction):
            row.unit, row.scale = "Hz", int(1 / said)
            return None
        counts, code = said
        if code is None:
            code = self._dialogue.needed("100 % is the parameter, such as P00.03", self._parameters.parameter)
        if not self._parameters.counts(code, "Hz", code.code):
            return None
        if not (code.low and code.high):
            ends = f"{code.code} may be from and to, in Hz, such as 10 400"
            code.take_range(*(f"{end:g}" for end in self._dialogue.needed(ends, lambda text: self._ends(code, text))))
        low, high = float(code.low), float(code.high)
        if row.low or row.high:
            row.without_range()
        row.unit, row.variant = "", "of_speed"
        return Share(code.code, counts, low, high, self._pages.source())

    def _ends(self, row: TableRow, text: str) -> tuple[float, float]:
        """The lowest and the highest value of *row*."""
        low, high = values.two_numbers(text)
        self._registers.beside.check_ends(row, low, high)
        return low, high

    def _count(self, row: TableRow, text: str) -> Fraction | tuple[int, TableRow | None]:
        """What one count is, or how many counts are a parameter, if that is said as well."""
        said = values.speed(text)
        if isinstance(said, tuple):
            counts, code = said
            self._registers.beside.check_share(row, counts)
            return counts, self._parameters.parameter(code) if code else None
        told = next((note for note in row.notes if "%" in note), None)
        if told is not None:
            self._dialogue.meant(told, text)
        self._registers.beside.check_step(row, "Hz", int(1 / said))
        return said
