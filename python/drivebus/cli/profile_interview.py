"""The questions of `drivebus profiles new`: what a manual says of a drive, one thing at a time.

Nothing is guessed: what the manual does not print is left out by Enter, and what may mean two things is asked again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

from drivebus import tables
from drivebus.cli import answer_values as values
from drivebus.cli.dialogue import Dialogue
from drivebus.cli.interview_parameters import ParameterQuestions
from drivebus.cli.interview_tables import Pages, TableQuestions, content, one_of
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.printed_words import prints_bits, prints_words, words_of
from drivebus.cli.profile_answers import Answers, Bits, Commands, Share, State
from drivebus.cli.wrong_use import WrongUse

__all__ = ["ask"]

T = TypeVar("T")

_COMMANDS = {
    "run_forward": "Word that runs the motor forward (clockwise; look which way it turns)",
    "run_reverse": "Word that runs it in reverse",
    "stop": "Word that stops it along its ramp",
    "coast": "Word that lets it coast",
}
_RESET = "Word that resets a fault; ADDRESS=WORD if it goes elsewhere, such as 2002H=2"
_STATES = {
    "forward": "while it runs forward",
    "reverse": "while it runs in reverse",
    "running": "while it runs, whichever way",
    "stopped": "while it stands still",
    "fault": "while it has a fault",
}
_SPEED_UNITS = {"Hz", "%", "rpm"}
_BY_BITS = ("fault", "forward", "reverse", "running", "stopped")
"""Of those that fit, the first counts, where none is a running motor."""


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
        self._used: list[TableRow] = []

    def fill(self, answers: Answers) -> None:
        """Asks for all that makes the drive known by name."""
        answers.commands = self._commands()
        answers.setpoint = self._register("Register that takes the speed", "Speed setpoint", "rw", _SPEED_UNITS)
        if answers.setpoint is not None:
            answers.is_read_back = bool(answers.setpoint.line) and answers.setpoint.access == "rw"
            answers.share = self._take_speed(answers.setpoint)
            if answers.setpoint.scale is None and answers.share is None:
                self._dialogue.say("Then its speed cannot be set by name.")
                answers.setpoint = None
        answers.state = self._state()
        answers.frequency = self._register("Register that tells the output frequency", "Output frequency", "ro", {"Hz"})
        if answers.frequency is not None and not self._parameters.counts(answers.frequency, "Hz", "it"):
            answers.frequency = None
        answers.fault = self._register("Register that tells the number of a fault", "Fault", "ro", set())
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

    def _commands(self) -> Commands | None:
        register = self._register("Register that takes run and stop", "Command to the motor", "wo", set())
        if register is None:
            return None
        _allow(register, "wo")
        words: dict[str, int] = {}
        elsewhere: dict[str, tuple[TableRow, int]] = {}
        for command, question in _COMMANDS.items():
            word = self._dialogue.optional(question, self._printed(register, words))
            if word is not None:
                words[command] = word
        reset = self._dialogue.optional(_RESET, lambda text: self._reset(text, register, words))
        if reset is not None:
            row, word = reset
            if row is register:
                words["reset_fault"] = word
            else:
                elsewhere["reset_fault"] = reset
        if not words:
            self._dialogue.say("Then it is not told anything by name.")
            return None
        if "run_forward" in words and not {"stop", "coast"} & set(words):
            self._dialogue.say("Without a stop and a coast it is not started by name.")
        _widen(register, [*words.values()])
        said = (f"{command.replace('_', ' ')} {word:04X}H" for command, word in words.items())
        self._dialogue.say(f"{register.name} ({tables.shown(register.address)}) takes {', '.join(said)}.")
        told = prints_words(register, words.values())
        source = self._pages.source_of(register, is_printed=told)
        is_printed = self._dialogue.agreed("Are these words in the manual of this very drive?", default=True)
        return Commands(register, words, elsewhere, is_printed, source)

    def _state(self) -> State | None:
        register = self._register("Register that tells what the motor does", "What the motor does", "ro", set())
        if register is None:
            return None
        register.scale = 1
        how = self._dialogue.needed(
            "It tells by one number for each state, or by bits (number, bits)", one_of(("number", "bits"))
        )
        if how == "number":
            numbers = self._each_state(_STATES, "Number", values.word)
            told = prints_words(register, numbers.values())
            return State(register, numbers, {}, self._pages.source_of(register, is_printed=told)) if numbers else None
        bits = self._each_state(_BY_BITS, "Bits, such as 0=1, 4-3=2,", values.bits, _is_shown)
        told = prints_bits(register, [field for each in bits.values() for field in each])
        return State(register, {}, bits, self._pages.source_of(register, is_printed=told)) if bits else None

    def _take_speed(self, row: TableRow) -> Share | None:
        """What a count of the setpoint is. Where it is a share of a frequency, of which."""
        _allow(row, "rw")
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
            self._is_meant(told, text)
        return said

    def _printed(self, row: TableRow, words: Mapping[str, int]) -> Callable[[str], int]:
        """What reads a word of a command; it asks once more where the table has words, and not this one."""
        told = " ".join(row.notes)
        numbers = words_of(row) if told else set()
        new = values.new(words, values.command_word)

        def read(text: str) -> int:
            word = new(text)
            if numbers and word not in numbers:
                self._is_meant(told, text)
            return word

        return read

    def _is_meant(self, told: str, text: str) -> None:
        question = f"{told[:1].upper()}{told[1:]}. Is it {text} all the same?"
        self._dialogue.insisted(question, f"{text} is not what the table says")

    def _each_state(
        self,
        states: Iterable[str],
        question: str,
        read: Callable[[str], T],
        check: Callable[[str, T, Mapping[str, T]], None] = lambda _state, _told, _known: None,
    ) -> dict[str, T]:
        """What tells each of *states*, where *check* agrees.

        Who has named a direction is not asked for a state without one.
        """
        known: dict[str, T] = {}
        new = values.new(known, read)
        for state in states:
            if state == "running" and {"forward", "reverse"} & set(known):
                continue

            def checked(text: str, state: str = state) -> T:
                told = new(text)
                check(state, told, known)
                return told

            told = self._dialogue.optional(f"{question} {_STATES[state]}", checked)
            if told is not None:
                known[state] = told
        return known

    def _register(self, question: str, label: str, access: str, units: set[str]) -> TableRow | None:
        """The row that is named by its name or address; one that no table has is made. It is in none but *units*."""
        question = f"{question}: name or address, such as 2000H"
        found = self._dialogue.optional(question, lambda text: self._free(text, units))
        if isinstance(found, int):
            found = self.table.add(found, label, self._pages.source())
        if found is not None:
            self._used.append(found)
        if found is not None and found.access == "unknown":
            found.access = access
        return found

    def _free(self, text: str, units: set[str]) -> TableRow | int:
        found = self._known_or_place(text)
        if isinstance(found, TableRow) and found.unit and found.unit not in units:
            raise WrongUse(f"{found.name} is in {found.unit}, by its table: it cannot be this")
        if any(found is row for row in self._used):
            raise WrongUse(f"{text} is the register of another answer")
        return found

    def _known_or_place(self, text: str) -> TableRow | int:
        row = self.table.called(text)
        if row is not None:
            return row
        table, address = values.place(text)
        row = self.table.at(address, table)
        if row is None and table != "holding":
            raise WrongUse(f'no table has "{text}", which is an input register')
        return address if row is None else row

    def _reset(self, text: str, register: TableRow, words: Mapping[str, int]) -> tuple[TableRow, int]:
        """A word that means one thing only to *register*, or another register and its word."""
        place, equals, said = (part.strip() for part in text.rpartition("="))
        named = self.table.called(place) if equals else register
        address = named.address if named is not None else values.place(place)[1]
        if address == register.address:
            return register, self._printed(register, words)(said)
        word = values.command_word(said)
        row = self.table.at(address) or self.table.add(address, "Fault reset", self._pages.source())
        _allow(row, "wo")
        _widen(row, [word])
        return row, word


def _is_shown(state: str, told: Bits, known: Mapping[str, Bits]) -> None:
    """That *told* leaves each state to be told: the first of *known* that fits is the one that counts."""
    for other, bits in known.items():
        shown = ", ".join(
            f"{high}={value}" if high == low else f"{high}-{low}={value}" for (high, low), value in bits.items()
        )
        if bits.items() <= told.items():
            raise WrongUse(f"{other} is told by {shown}, and so {state} would never be. Which bit is another one then?")
        if state == "stopped" and told.items() <= bits.items():
            raise WrongUse(f"a motor that runs {other} shows that too ({shown})")


def _most_words(text: str) -> int:
    count = values.word(text.strip())
    if not 1 <= count <= 125:
        raise WrongUse(f"{count} is not in the range from 1 to 125")
    return count


def _allow(row: TableRow, access: str) -> None:
    """That *row* can be written, whatever its table says of it."""
    if row.access in {"ro", "unknown"}:
        if row.access == "ro":
            row.notes.append("the table says that it is read only")
        row.access = access


def _widen(row: TableRow, words: list[int]) -> None:
    """The words of commands are whole numbers; a range of the table that is without them goes to the note."""
    row.unit, row.scale = "", 1
    if (row.low or row.high) and not all(float(row.low or 0) <= word <= float(row.high or 0xFFFF) for word in words):
        row.without_range()
