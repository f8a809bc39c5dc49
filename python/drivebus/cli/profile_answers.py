"""What a manual says of a drive, as the one answers who reads it, and the rules of a profile that come of it."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from drivebus.cli.manual_cells import TableRow
from drivebus.cli.manual_table import ManualTable

__all__ = ["Answers", "Bits", "Commands", "Ramp", "Setting", "Share", "State", "Watchdog"]

Bits = Mapping[tuple[int, int], int]
"""Of a word, the highest and the lowest bit of a field, and what stands there."""

_MOST_SHOWN = 8
_READY = "ready"
"""The bit that tells whether a drive can be started."""


@dataclass
class Commands:
    """How the motor is told what to do.

    Attributes:
        register: What takes the words.
        words: The word of each command.
        elsewhere: Commands in other registers.
        is_printed: Whether the manual of this very drive prints them.
        source: Document and page.
    """

    register: TableRow
    words: dict[str, int]
    elsewhere: dict[str, tuple[TableRow, int]]
    is_printed: bool
    source: str


@dataclass
class State:
    """Where the drive tells what the motor does: by one number for each state, or by bits."""

    register: TableRow
    numbers: dict[str, int]
    bits: dict[str, Bits]
    source: str

    def shown_by(self, word: int) -> str | None:
        """The state that *word* shows; None where it is none of them."""
        by_number = (name for name, number in self.numbers.items() if number == word)
        by_bits = (name for name, bits in self.bits.items() if all(_field(word, at) == bits[at] for at in bits))
        return next(by_number, None) or next(by_bits, None)

    def fields(self) -> list[tuple[int, int]]:
        """Highest and lowest bit of each field: of those that tell a state, and of others that its table names."""
        fields = list(dict.fromkeys(place for bits in self.bits.values() for place in bits))
        taken = {bit for high, low in fields for bit in range(low, high + 1)}
        named = (place for place in self.register.bits if not taken.intersection(range(place[1], place[0] + 1)))
        return [*fields, *named]

    def name(self, place: tuple[int, int]) -> str:
        """What a field is called: as the table has it, or by its bits."""
        high, low = place
        return self.register.bits.get(place) or (f"bit_{high}" if high == low else f"bits_{high}_{low}")

    def names(self) -> list[str]:
        """What all fields are called, where it tells by bits."""
        return [self.name(place) for place in self.fields()] if self.bits else []


@dataclass
class Share:
    """A setpoint of so many *counts* is what *parameter* says, from *low* to *high* Hz."""

    parameter: str
    counts: int
    low: float
    high: float
    source: str


@dataclass
class Setting:
    """What a parameter must be, so that the drive obeys the bus."""

    code: str
    value: int
    label: str
    source: str


@dataclass
class Ramp:
    """A stop takes what *time* says, from the frequency in *start* to 0."""

    time: str
    start: str


@dataclass
class Watchdog:
    """What the drive does where the bus is silent for *timeout*: *action* says it, if there is such a parameter.

    *fault* is the number of the fault that it trips.
    """

    timeout: str
    action: str
    words: dict[str, int]
    fault: int | None
    source: str


@dataclass
class Answers:
    """What was answered. What the manual does not say is None, or empty.

    Attributes:
        title: Maker and series.
        manual: Document and edition.
        table: The rows of its tables.
        serial: Speed, format and unit as the drive leaves the factory, and where that is printed.
        writes: The functions that write words: 6, 16, or both.
        max_words: The most words in one request.
        is_read_back: Whether the table says that the setpoint can be read.
        faults: Number, code on the keypad and meaning of each.
    """

    title: str
    manual: str
    table: ManualTable
    serial: tuple[int, str, int, str] | None = None
    writes: list[int] = field(default_factory=lambda: [6])
    max_words: int = 1
    requests_source: str = ""
    commands: Commands | None = None
    state: State | None = None
    setpoint: TableRow | None = None
    share: Share | None = None
    frequency: TableRow | None = None
    fault: TableRow | None = None
    is_read_back: bool = False
    control: list[Setting] = field(default_factory=list)
    ramp: Ramp | None = None
    watchdog: Watchdog | None = None
    faults: list[tuple[int, str, str]] = field(default_factory=list)
    faults_source: str = ""

    def rules(self, folder: str, name: str) -> str:
        """The text of `profile.toml`."""
        return "\n".join(self._rules(folder, name))

    def fault_rows(self) -> str:
        """The rows of `faults.csv`."""
        text = io.StringIO()
        rows = ((code, mnemonic, label, "", "", "yes", "", self.faults_source) for code, mnemonic, label in self.faults)
        csv.writer(text, lineterminator="\n").writerows(rows)
        return text.getvalue()

    def _rules(self, folder: str, name: str) -> Iterator[str]:
        yield "#:schema ./profile.schema.json"
        yield "# Made of answers to questions. profile.schema.json says what else may stand here. After each change:"
        yield f"#   drivebus profiles check {folder}"
        yield ""
        yield from _keys(name=name, title=self.title, kind="inverter", version=1, source=self.manual)
        if self.serial is not None:
            baud_rate, characters, unit, source = self.serial
            yield from _table("serial", baud_rate=baud_rate, format=characters, unit=unit, verified=True, source=source)
        yield from self._requests()
        # A code in a table with addresses may be anything.
        yield from _table("parameters", address="listed", source=self.manual)
        if self.commands is not None:
            yield from self._commands(self.commands)
        if self.state is not None:
            yield from self._state(self.state)
        roles = {"fault": self.fault, "frequency": self.frequency}
        if self.is_read_back:
            roles["setpoint"] = self.setpoint
        yield from _table("status", **{role: row.name for role, row in roles.items() if row is not None})
        if self.state is not None and _READY in self.state.names():
            yield from _keys(words=[self.state.register.name])
        if self.ramp is not None:
            yield from _table("ramp", deceleration=self.ramp.time, start=self.ramp.start)
        for setting in self.control:
            yield from _table("[control]", code=setting.code, value=setting.value, label=setting.label, verified=True)
            yield from _keys(source=setting.source)
        if self.setpoint is not None:
            yield from _table("setpoints.frequency", register=self.setpoint.name)
        if self.share is not None:
            yield from self._share(self.share)
        if self.watchdog is not None:
            action = {"action": self.watchdog.action} if self.watchdog.action else {}
            yield from _table("watchdog", timeout=self.watchdog.timeout, **action, **self.watchdog.words)
            if self.watchdog.fault is not None:
                yield from _keys(fault=self.watchdog.fault)
            yield from _keys(verified=True, source=self.watchdog.source)
        yield from _table("monitor", registers=self._shown())
        if self.state is not None and self.state.bits:
            yield from self._bits(self.state)

    def _requests(self) -> Iterator[str]:
        tables = {row.table for row in self.table.rows}
        functions = [3, *[4] * ("input" in tables), *self.writes]
        source = self.requests_source or "not printed: what nearly every drive can"
        yield from _table("requests", functions=functions, max_words=self.max_words, source=source)

    def _commands(self, commands: Commands) -> Iterator[str]:
        moves = dict.fromkeys([commands.register.name, *(row.name for row, _ in commands.elsewhere.values())])
        register = commands.register.name
        yield from _table("commands", register=register, moves=list(moves), source=commands.source)
        if commands.is_printed:
            yield from _table("commands.codes", **commands.words)
        else:
            yield from _table("commands.codes")
            yield from _table("commands.assumed", reason="the manual of this drive does not print them")
            said = ", ".join(f"{command} = {word}" for command, word in commands.words.items())
            yield f"codes = {{ {said} }}"
        if commands.elsewhere:
            yield from _table("commands.elsewhere")
            for command, (row, word) in commands.elsewhere.items():
                yield f"{command} = {{ register = {_said(row.name)}, code = {word} }}"

    def _state(self, state: State) -> Iterator[str]:
        # Whether "stopped" is said while the motor still slows down is what few manuals print.
        yield from _table("state", register=state.register.name, source=state.source)
        if self.frequency is not None:
            yield "rest_by_frequency = true"
        if state.numbers:
            yield from _table("state.codes", **state.numbers)
        for name, bits in state.bits.items():
            fields = ", ".join(f"{state.name(place)} = {value}" for place, value in bits.items())
            yield from _table("[state.when]", **{"is": name})
            yield f"fields = {{ {fields} }}"

    def _share(self, share: Share) -> Iterator[str]:
        yield from _table("variants.of_speed", parameter=share.parameter, verified=True, source=share.source)
        yield from _table("variants.of_speed.share", counts=share.counts, low=share.low, high=share.high)

    def _bits(self, state: State) -> Iterator[str]:
        yield from _table("bits")
        yield f"{state.register.name} = ["
        for place in state.fields():
            name = state.name(place)
            values = ', values = { 0 = "not ready", 1 = "ready" }' if name == _READY else ""
            yield f"    {{ name = {_said(name)}, bits = [{place[0]}, {place[1]}]{values} }},"
        yield "]"

    def _shown(self) -> list[str]:
        """What `monitor` shows: what tells the state, and what has a unit."""
        roles = [None if self.state is None else self.state.register, self.frequency, self.fault]
        measured = [row for row in self.table.registers if row.access == "ro" and row.scale is not None and row.unit]
        names = [row.name for row in (*roles, *measured) if row is not None]
        return list(dict.fromkeys(names))[:_MOST_SHOWN]


def _field(word: int, at: tuple[int, int]) -> int:
    """What stands in *word* between two bits, the highest one first."""
    high, low = at
    return word >> low & (1 << high - low + 1) - 1


def _table(name: str, **keys: object) -> Iterator[str]:
    yield ""
    yield f"[{name}]"
    yield from _keys(**keys)


def _keys(**keys: object) -> Iterator[str]:
    for key, value in keys.items():
        yield f"{key} = {_said(value)}"


def _said(value: object) -> str:
    """*value* as TOML has it: JSON has the same strings, numbers and lists."""
    return json.dumps(value, ensure_ascii=False)
