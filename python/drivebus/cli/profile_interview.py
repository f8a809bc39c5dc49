"""The questions of `drivebus profiles new`: what a manual says of a drive, one thing at a time.

Nothing is guessed: what the manual does not print is left out by Enter, and what may mean two things is asked again.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

import click

import drivebus
from drivebus.cli.manual_cells import COUNTS, SCALES, TableRow, UnclearAddresses, place_of
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.present.output import remark
from drivebus.cli.profile_answers import Answers, Bits, Commands, Setting, Share, State
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
_BY_BITS = ("fault", "forward", "reverse", "running", "stopped")
"""Of those that fit, the first counts, where none is a running motor."""
_ADDRESS = r"0x[0-9a-f]{1,4}|[0-9a-f]{1,4}h|[34]\d{4,5}"


def ask(table: Path | None, source: str | None, count: str | None) -> Answers:
    """Asks who has the manual; *table* and *source* are of a first table, *count* is how addresses are written.

    Raises:
        click.Abort: The input ended, or Ctrl-C was pressed.
        WrongUse: *table* cannot be read.
    """
    remark("The manual's chapter on Modbus answers what follows. Enter leaves out what it does not print.")
    title = _needed("Maker and series, as the drive's plate has them", _text)
    manual = _needed("The manual: title or number, edition", _text)
    interview = _Interview(manual)
    if table is not None and source is not None:
        interview.take(table.read_bytes(), source, count)
    interview.take_tables(count)
    answers = Answers(title, manual, interview.table)
    interview.fill(answers)
    return answers


class _Interview:
    """The questions that go on from what was answered before: pages, and the rows of tables."""

    def __init__(self, manual: str) -> None:
        self.table = ManualTable()
        self._manual = manual
        self._page = ""
        self._used: list[TableRow] = []

    def take_tables(self, count: str | None) -> None:
        """Tables of the manual, until there are no more."""
        remark("Tables of registers or parameters spare you typing: CSV, or text as pasted, its line of titles first.")
        while (found := _optional("File with a table (- to paste one; Enter: no more)", _content)) is not None:
            try:
                self.take(found, self._source(), count)
            except (drivebus.NotAllowed, WrongUse) as error:
                remark(f"Error: {error}")

    def take(self, data: bytes, source: str, count: str | None) -> None:
        """Adds a table, and says what was left out of it."""
        try:
            rows = self.table.read(data, source, count=count)
        except UnclearAddresses:
            count = click.prompt("Its addresses are", type=click.Choice(COUNTS[:3]), err=True)
            rows = self.table.read(data, source, count=count)
        for line, why in sorted(self.table.left_out):
            remark(f"line {line} is left out: {why}")
        for row in rows:
            if row.notes:
                remark(f"line {row.line}, {row.code or row.name}: {'; '.join(row.notes)}")
        for kind, found in (("Registers", [row for row in rows if not row.code]), ("Parameters", [*_coded(rows)])):
            if found:
                remark(f"{kind}: {', '.join(f'{row.code or row.name} at {row.address:04X}H' for row in found)}.")

    def fill(self, answers: Answers) -> None:
        """Asks for all that makes the drive known by name."""
        answers.commands = self._commands()
        answers.setpoint = self._register("Register that takes the speed", "Speed setpoint", access="rw")
        if answers.setpoint is not None:
            answers.share = self._take_speed(answers.setpoint)
            if answers.setpoint.scale is None and answers.share is None:
                remark("Then its speed cannot be set by name.")
                answers.setpoint = None
        answers.state = self._state()
        answers.frequency = self._register("Register that tells the output frequency", "Output frequency", access="ro")
        if answers.frequency is not None and not self._is_in_hertz(answers.frequency):
            answers.frequency = None
        answers.fault = self._register("Register that tells the number of a fault", "Fault", access="ro")
        if answers.fault is not None and answers.fault.scale is None:
            answers.fault.scale = 1
        answers.control.extend(self._control())
        if any(row.access == "unknown" for row in self.table.parameters):
            only_at_rest = click.confirm("Are parameters written only while the motor stands?", default=True, err=True)
            for row in self.table.parameters:
                row.access = "stop" if only_at_rest and row.access == "unknown" else row.access
        answers.writes = int(
            click.prompt("Function that writes a word", default="6", type=click.Choice(["6", "16"]), err=True)
        )
        answers.max_words = click.prompt(
            "Most words in one request; 1 is never wrong", default=1, type=click.IntRange(1, 125), err=True
        )
        answers.requests_source = self._source() if answers.max_words > 1 or answers.writes != 6 else ""
        line = _optional("The line as it leaves the factory: speed, format, unit, such as 9600 8N1 1", _line)
        if line is not None:
            answers.serial = (*line, self._source())

    def _commands(self) -> Commands | None:
        register = self._register("Register that takes run and stop", "Command to the motor", access="wo")
        if register is None:
            return None
        _allow(register, "wo")
        source = self._source_of(register)
        words: dict[str, int] = {}
        elsewhere: dict[str, tuple[TableRow, int]] = {}
        for command, question in _COMMANDS.items():
            word = _optional(question, _new(words, _word))
            if word is not None:
                words[command] = word
        if (reset := _optional(_RESET, lambda text: self._reset(text, register, words))) is not None:
            row, word = reset
            if row is register:
                words["reset_fault"] = word
            else:
                elsewhere["reset_fault"] = reset
        if not words:
            remark("Then it is not told anything by name.")
            return None
        if "run_forward" in words and not {"stop", "coast"} & set(words):
            remark("Without a stop and a coast it is not started by name.")
        _widen(register, [*words.values()])
        is_printed = click.confirm("Are these words in the manual of this very drive?", default=True, err=True)
        return Commands(register, words, elsewhere, is_printed, source)

    def _state(self) -> State | None:
        register = self._register("Register that tells what the motor does", "What the motor does", access="ro")
        if register is None:
            return None
        source = self._source_of(register)
        register.scale = 1
        how = click.prompt(
            "It tells by one number for each state, or by bits", type=click.Choice(["number", "bits"]), err=True
        )
        if how == "number":
            numbers = _each_state(_STATES, "Number", _word)
            return State(register, numbers, {}, source) if numbers else None
        bits = _each_state(_BY_BITS, "Bits, such as 0=1, 4-3=2,", _bits)
        return State(register, {}, bits, source) if bits else None

    def _take_speed(self, row: TableRow) -> Share | None:
        """What a count of the setpoint is. Where it is a share of a frequency, of which."""
        _allow(row, "rw")
        if row.unit == "Hz" and row.scale is not None:
            return None
        said = _optional("One count of it is, such as 0.01 Hz; or counts that are a frequency, 10000 = P00.03", _speed)
        row.scale = None
        if said is None:
            return None
        if isinstance(said, Fraction):
            row.unit, row.scale = "Hz", int(1 / said)
            return None
        counts, of = said
        code = self._parameter(of) if of else _needed("100 % is the parameter, such as P00.03", self._parameter)
        if code.scale is None or code.unit != "Hz":
            code.unit, code.scale = "Hz", int(1 / _needed("One count of it is, such as 0.01 Hz", _hertz))
        if not (code.low and code.high):
            low, high = _needed(f"{code.code} may be from and to, in Hz, such as 10 400", _two_numbers)
            code.low, code.high = f"{low:g}", f"{high:g}"
        low, high = float(code.low), float(code.high)
        if row.low or row.high:
            row.without_range()
        row.unit, row.variant = "", "of_speed"
        return Share(code.code, counts, low, high, self._source())

    def _is_in_hertz(self, row: TableRow) -> bool:
        if row.unit != "Hz" or row.scale is None:
            step = _optional("One count of it is, such as 0.01 Hz", _hertz)
            row.unit, row.scale = ("Hz", int(1 / step)) if step is not None else (row.unit, row.scale)
        return row.unit == "Hz" and row.scale is not None

    def _control(self) -> Iterator[Setting]:
        question = "Parameter that must be set so that the bus gives commands, or the speed: P00.01=2 (Enter: no more)"
        while (found := _optional(question, self._setting)) is not None:
            row, value = found
            if row.scale is None:
                row.scale = 1
            yield Setting(row.code, value, self._source_of(row))

    def _setting(self, text: str) -> tuple[TableRow, int]:
        code, equals, value = text.partition("=")
        if not equals:
            raise WrongUse(f'"{text}" is no parameter and value, such as P00.01=2')
        return self._parameter(code.strip()), _word(value.strip())

    def _parameter(self, text: str) -> TableRow:
        """A parameter by its code, or by the name or the address of its row."""
        called = text.lower()
        row = next((row for row in self.table.rows if called in {row.code.lower() or None, row.name}), None)
        if row is None and re.fullmatch(_ADDRESS, called):
            row = self._at(_place(text)[1])
            if row is None:
                raise WrongUse(f"no table has {text}; say its code, as the keypad shows it")
        if row is not None:
            row.code = row.code or _needed(f"The code of {row.name}, as the keypad shows it", _code)
            return row
        code = _code(text)
        found = _optional(f"No table has {code}. Its address on the bus (Enter: another code)", _place)
        if found is None or found[0] != "holding":
            raise WrongUse(f"{code} needs the address of a holding register")
        row = self._at(found[1]) or self.table.add(found[1], code, self._source())
        row.code = row.code or code
        return row

    def _register(self, question: str, label: str, *, access: str) -> TableRow | None:
        """The row that is named by its name or address; one that no table has is made."""
        found = _optional(f"{question}: name or address, such as 2000H", self._free)
        if isinstance(found, int):
            found = self.table.add(found, label, self._source())
        if found is not None:
            self._used.append(found)
        if found is not None and found.access == "unknown":
            found.access = access
        return found

    def _free(self, text: str) -> TableRow | int:
        found = self._known_or_place(text)
        if any(found is row for row in self._used):
            raise WrongUse(f"{text} is the register of another answer")
        return found

    def _known_or_place(self, text: str) -> TableRow | int:
        row = next((row for row in self.table.rows if text.lower() in {row.name, row.code.lower() or None}), None)
        if row is not None:
            return row
        table, address = _place(text)
        row = next((row for row in self.table.rows if (row.table, row.address) == (table, address)), None)
        if row is None and table != "holding":
            raise WrongUse(f'no table has "{text}", which is an input register')
        return address if row is None else row

    def _at(self, address: int) -> TableRow | None:
        return next((row for row in self.table.rows if (row.table, row.address) == ("holding", address)), None)

    def _reset(self, text: str, register: TableRow, words: Mapping[str, int]) -> tuple[TableRow, int]:
        """A word that means one thing only to *register*, or another register and its word."""
        place, equals, said = (part.strip() for part in text.rpartition("="))
        address = _place(place)[1] if equals else register.address
        if address == register.address:
            return register, _new(words, _word)(said)
        word = _word(said)
        row = self._at(address) or self.table.add(address, "Fault reset", self._source())
        _allow(row, "wo")
        _widen(row, [word])
        return row, word

    def _source_of(self, row: TableRow) -> str:
        """Where the words of a register are printed; one that no table has was just asked for its page."""
        if not row.line:
            return row.source
        if row.source.startswith(f"{self._manual}, "):
            self._page = row.source.removeprefix(f"{self._manual}, ").removeprefix("p. ")
        return self._source("Page that says what its words mean")

    def _source(self, question: str = "Its page") -> str:
        """Document and page; the page before is offered."""
        page = click.prompt(question, default=self._page or None, err=True)
        self._page = " ".join(str(page).split())
        return f"{self._manual}, {f'p. {self._page}' if self._page.isdecimal() else self._page}"


def _each_state(states: Iterable[str], question: str, read: Callable[[str], T]) -> dict[str, T]:
    """What tells each of *states*. Who has named a direction is not asked for a state without one."""
    known: dict[str, T] = {}
    for state in states:
        if state == "running" and {"forward", "reverse"} & set(known):
            continue
        told = _optional(f"{question} {_STATES[state]}", _new(known, read))
        if told is not None:
            known[state] = told
    return known


def _needed(question: str, read: Callable[[str], T]) -> T:
    answer: T = click.prompt(question, value_proc=read, err=True)
    return answer


def _optional(question: str, read: Callable[[str], T]) -> T | None:
    def taken(said: str) -> T | None:
        return read(said.strip()) if said.strip() else None

    answer: T | None = click.prompt(question, default="", show_default=False, value_proc=taken, err=True)
    return answer


def _coded(rows: Iterable[TableRow]) -> Iterator[TableRow]:
    return (row for row in rows if row.code)


def _code(text: str) -> str:
    if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,15}", text) is None:
        raise WrongUse(f'"{text}" is no code of a parameter, such as P00.03 or F0-10')
    return text


def _text(text: str) -> str:
    said = " ".join(text.split())
    if not said:
        raise WrongUse("this is needed")
    return said


def _content(text: str) -> bytes:
    """What is in a file, or is pasted until a line with a single dot."""
    if text != "-":
        try:
            return Path(text).read_bytes()
        except OSError as error:
            raise WrongUse(f"{text}: {error.strerror or error}") from error
    remark("Paste it; then a dot on a line of its own.")
    lines: list[str] = []
    while (line := sys.stdin.readline()).strip() != "." and line:
        lines.append(line)
    return "".join(lines).encode()


def _place(text: str) -> tuple[str, int]:
    """Table and address of a register, where they can be read in one way only."""
    plain = text.lower().replace(" ", "")
    is_hex = plain.startswith("0x") or plain.endswith("h") or re.search("[a-f]", plain) is not None
    found = place_of(text, "hex") if is_hex else place_of(text, "40001")
    if found is None:
        both = f": it may be {plain}H, or {int(plain)} as 0x{int(plain):04X}" if re.fullmatch(r"\d{1,4}", plain) else ""
        raise WrongUse(
            f'"{text}" is no name of the tables and no address{both}. '
            "Write 2000H, 0x2000, or 48193 for the 8193rd register"
        )
    return found


def _word(text: str) -> int:
    """A word in decimal, or in hexadecimal with its sign."""
    found = re.fullmatch(r"0x([0-9a-f]{1,4})|([0-9a-f]{1,4})h|(0|[1-9]\d{0,4})", text.lower())
    if found is None or (found[3] and int(found[3]) > 0xFFFF):
        raise WrongUse(f'"{text}" is no word from 0 to 65535: write 18, 12H or 0x12')
    return int(found[3]) if found[3] else int(found[1] or found[2], 16)


def _new(known: Mapping[str, T], read: Callable[[str], T]) -> Callable[[str], T]:
    """What reads a thing that means one thing only."""

    def read_new(text: str) -> T:
        answer = read(text)
        other = next((name for name, value in known.items() if value == answer), None)
        if other is not None:
            raise WrongUse(f"{text} is {other.replace('_', ' ')} already")
        return answer

    return read_new


def _bits(text: str) -> Bits:
    """Fields of a word and their values, `0=1, 4-3=2`."""
    found: dict[tuple[int, int], int] = {}
    for part in filter(None, re.split(r"[, ]+", text)):
        said = re.fullmatch(r"(?:bit)?(\d{1,2})(?:-(\d{1,2}))?=(\d{1,16})", part.lower())
        if said is None:
            raise WrongUse(f'"{part}" is no bit and what it is, such as 0=1, or 4-3=2 for two of them')
        ends = sorted((int(said[1]), int(said[2] or said[1])), reverse=True)
        width = ends[0] - ends[1] + 1
        # As many digits of 0 and 1 as there are bits are these bits: in decimal they would not fit.
        is_binary = len(said[3]) == width and set(said[3]) <= {"0", "1"}
        value = int(said[3], 2 if is_binary else 10)
        if ends[0] > 15 or value >> width:
            raise WrongUse(f'"{part}": a word has the bits 0 to 15, and {said[3]} does not fit in that')
        found[ends[0], ends[1]] = value
    return found


def _hertz(text: str) -> Fraction:
    """What one count is."""
    said = re.fullmatch(r"(\d*[.,]?\d+) ?hz", text.lower())
    step = Fraction(said[1].replace(",", ".")) if said else Fraction(0)
    if not step or 1 / step not in SCALES:
        raise WrongUse(f'"{text}" is no 1, 0.1, 0.01 or 0.001 Hz, such as 0.01 Hz')
    return step


def _speed(text: str) -> Fraction | tuple[int, str]:
    """What one count is; or how many counts are a parameter, by its code, which may follow."""
    share = re.fullmatch(r"(\d*[.,]?\d+) ?%.*", text)
    step = Fraction(share[1].replace(",", ".")) if share else Fraction(0)
    whole = re.fullmatch(r"(\d{2,5}) ?= ?(.+)", text)
    counts = 100 / step if step else Fraction(whole[1]) if whole else None
    if counts is None:
        return _hertz(text)
    if counts.denominator != 1 or counts > 0xFFFF:
        raise WrongUse(f'"{text}" is no 1 to 65535 counts: write 10000 = P00.03, or 0.01 %')
    of = whole[2].strip() if whole else ""
    return int(counts), "" if "%" in of else of


def _two_numbers(text: str) -> tuple[float, float]:
    found = [float(each) for each in re.findall(r"\d+(?:\.\d+)?", text)]
    if len(found) != 2 or not 0 <= found[0] < found[1]:
        raise WrongUse(f'"{text}" is no lowest and highest frequency, such as 10 400')
    return found[0], found[1]


def _line(text: str) -> tuple[int, str, int]:
    said = re.fullmatch(r"(\d{3,6})[ ,]+(8[neo][12])[ ,]+(\d{1,3})", text.lower())
    if said is None or not 1 <= int(said[3]) <= 247:
        raise WrongUse(f'"{text}" is no speed, format and unit, such as 9600 8N1 1')
    return int(said[1]), said[2].upper(), int(said[3])


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
