"""The questions about parameters: what must be set, how long a stop takes, and what a silent bus does."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.drive_beside import DriveBeside
from drivebus.cli.interview_registers import insist
from drivebus.cli.interview_tables import Pages
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.profile_answers import Ramp, Setting, Watchdog
from drivebus.cli.wrong_use import WrongUse

__all__ = ["ParameterQuestions"]

_NO_BUS = re.compile(r"key|panel|terminal|pot|analog|remote i/?o", re.IGNORECASE)
"""Where commands or the speed come from, if not over the bus."""
_ON_SILENCE = {
    "stop": ("Its value for a stop along the ramp", re.compile(r"ramp|decel|stop", re.IGNORECASE)),
    "coast": ("Its value for a coast", re.compile(r"coast|free|spin", re.IGNORECASE)),
    "trip": ("Its value for a trip, where neither of the two is one", re.compile(r"trip|fault|alarm", re.IGNORECASE)),
}
"""How each is asked for, and what a table may call it."""
_ADDRESS = r"0x[0-9a-f]{1,4}|[0-9a-f]{1,4}h|[34]\d{4,5}"


class ParameterQuestions:
    """What is asked about the parameters of *table*, and of those that it has not."""

    def __init__(self, dialogue: Dialogue, pages: Pages, table: ManualTable, beside: DriveBeside) -> None:
        self._dialogue = dialogue
        self._pages = pages
        self._table = table
        self._beside = beside

    def control(self) -> Iterator[Setting]:
        """What must be set so that the drive obeys the bus."""
        question = "Parameter that must be set so that the bus gives commands, or the speed: P00.01=2 (Enter: no more)"
        while (found := self._dialogue.optional(question, self._setting)) is not None:
            row, value = found
            if row.scale is None:
                row.scale = 1
            if not (row.choices or row.low or row.high):
                ends = f"{row.code} may be from and to, such as 0 3 (Enter: not printed; then it is set by hand)"
                between = self._dialogue.optional(ends, values.two_numbers)
                if between is not None:
                    row.take_range(*(f"{end:g}" for end in between))
            yield Setting(row.code, value, row.label, row.source)

    def _setting(self, text: str) -> tuple[TableRow, int]:
        code, equals, value = text.partition("=")
        if not equals:
            raise WrongUse(f'"{text}" is no parameter and value, such as P00.01=2')
        row = self.parameter(code.strip())
        called = next((number for number, label in row.choices.items() if label.lower() == value.strip().lower()), None)
        word = values.word(value.strip()) if called is None else called
        if row.choices and word not in row.choices:
            known = ", ".join(f"{number} {label}" for number, label in row.choices.items())
            question = f"The table has {known}. Is {word} printed all the same?"
            self._dialogue.insisted(question, f"{row.code} cannot be {word}")
            row.choices[word] = "not in the table"
        elif not row.choices and not float(row.low or 0) <= word / (row.scale or 1) <= float(row.high or 0xFFFF):
            raise WrongUse(f"{row.code} is from {row.low} to {row.high} by its table: it cannot be {word}")
        self._beside.check(row)
        if _NO_BUS.search(row.choices.get(word, "")):
            self._insist(row, word, "obeys the bus")
        return row, word

    def _insist(self, row: TableRow, word: int, what: str) -> None:
        called = f"{row.code} = {word} is {row.choices[word]}"
        self._dialogue.insisted(f"{called}, by its table. Is it what {what} all the same?", called)

    def ramp(self) -> Ramp | None:
        """What tells how long a stop takes, so that it is known when the motor should stand."""
        time = self._named("Parameter with the time in seconds of the ramp of a stop", "stop time", {"s", "ms", "min"})
        if time is None:
            return None
        start = self._named("Parameter with the frequency which that time begins from", "frequency", {"Hz"})
        if start is None or not (self.counts(time, "s", time.code) and self.counts(start, "Hz", start.code)):
            self._dialogue.say("Then a stop waits for standstill, however long that is.")
            return None
        return Ramp(time.code, start.code)

    def watchdog(self) -> Watchdog | None:
        """What the drive does of its own where the bus is silent."""
        timeout = self._named("Parameter with the time after which it acts on a silent bus", "time", {"s", "ms", "min"})
        if timeout is None or not self.counts(timeout, "s", timeout.code):
            return None
        action = self._dialogue.optional("Parameter that says what it does then", self.parameter)
        if action is None:
            return Watchdog(timeout.code, "", {}, self._fault(), timeout.source)
        action.scale = 1 if action.scale is None else action.scale
        known: dict[str, int] = {}
        for what, (question, means) in _ON_SILENCE.items():
            word = self._dialogue.optional(question, self._on_silence(action, what, means, known))
            if word is not None:
                known[what] = word
        return Watchdog(timeout.code, action.code, known, self._fault(), timeout.source)

    def _fault(self) -> int | None:
        return self._dialogue.optional("The number of the fault that it trips then", values.word)

    def _on_silence(
        self, action: TableRow, what: str, means: re.Pattern[str], known: Mapping[str, int]
    ) -> Callable[[str], int]:
        """What reads the value of *action* for *what*; it asks once more where the table has other words for it."""
        read_new = values.new(known, values.word)

        def read(text: str) -> int:
            word = read_new(text)
            if action.choices and word not in action.choices:
                listed = ", ".join(f"{number} {label}" for number, label in action.choices.items())
                raise WrongUse(f"the table has {listed}")
            label = action.choices.get(word, "")
            others = (other for name, (_, other) in _ON_SILENCE.items() if name != what)
            if means.search(label) is None and any(other.search(label) for other in others):
                self._insist(action, word, f"makes it {what}")
            return word

        return read

    def counts(self, row: TableRow, unit: str, called: str) -> bool:
        """Whether it is known how many counts of *row* one *unit* has, or it is said now."""
        if row.unit != unit or row.scale is None:
            such = "0.1 s" if unit == "s" else f"0.01 {unit}"
            question = f"One count of {called} is, such as {such}"
            step = self._dialogue.optional(question, lambda text: self._step(row, text, unit))
            if step is None:
                return False
            row.unit, row.scale = unit, int(1 / step)
            row.take_printed()
        return True

    def _step(self, row: TableRow, text: str, unit: str) -> Fraction:
        step = values.step(text, unit)
        self._beside.check_step(row, unit, int(1 / step))
        return step

    def take_access(self) -> None:
        """Which parameters may be written while the motor turns, where their table does not tell."""
        unknown = {row.code.lower(): row for row in self._table.parameters if row.access == "unknown"}
        if not unknown:
            return
        asked = ", ".join(row.code for row in unknown.values())
        question = f"Which of {asked} may be written while the motor turns: codes, or all (Enter: none)"

        def codes(text: str) -> list[TableRow]:
            said = [*unknown] if text.lower() == "all" else re.split(r"[, ]+", text.lower())
            wrong = next((code for code in said if code not in unknown), None)
            if wrong is not None:
                raise WrongUse(f'"{wrong}" is none of {asked}')
            return [unknown[code] for code in said]

        for row in self._dialogue.optional(question, codes) or []:
            row.access = "run"
        for row in unknown.values():
            row.access = "stop" if row.access == "unknown" else row.access

    def _named(self, question: str, kind: str, units: set[str]) -> TableRow | None:
        """The parameter that is named, whose name and unit do not speak against it, or it is meant all the same."""

        def read(text: str) -> TableRow:
            row = self.parameter(text)
            insist(self._dialogue, row, question, kind, units)
            self._beside.check(row)
            return row

        return self._dialogue.optional(question, read)

    def parameter(self, text: str) -> TableRow:
        """A parameter by its code, or by the name or the address of its row."""
        row = self._table.called(text)
        if row is None and re.fullmatch(_ADDRESS, text.lower()):
            row = self._table.at(values.place(text)[1])
            if row is None:
                raise WrongUse(f"no table has {text}; say its code, as the keypad shows it")
        if row is not None:
            called = f"The code of {row.name}, as the keypad shows it"
            row.code = row.code or self._dialogue.needed(called, values.code)
            return row
        code = values.code(text)
        question = f"No table has {code}. Its address on the bus (Enter: another code)"
        found = self._dialogue.optional(question, values.place)
        if found is None or found[0] != "holding":
            raise WrongUse(f"{code} needs the address of a holding register")
        self._beside.check_place(found[1])
        row = self._table.at(found[1]) or self._table.add(found[1], code, self._pages.source())
        row.code = row.code or code
        return row
