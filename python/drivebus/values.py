"""What a drive says, as values a program can use: choices, states, faults, snapshots.

Plain data: nothing here reads from a drive or knows how its words are laid out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Literal, TypeAlias

from drivebus import tables
from drivebus.attribute_mapping import Named

__all__ = [
    "Choice",
    "Control",
    "ControlItem",
    "ControlSource",
    "Description",
    "Fault",
    "Snapshot",
    "State",
    "Status",
    "Value",
    "WatchdogSettings",
    "group_of",
]


Access: TypeAlias = Literal["rw", "ro", "wo", "run", "stop", "unknown"]
"""Whether and when something may be written; see `Description`."""

Evidence: TypeAlias = Literal["verified", "unverified", "assumed"]
"""How well documents prove something; see `Description`."""

Kind: TypeAlias = Literal["register", "parameter"]


class Choice(int):
    """A number that the drive gives a name: an int in every respect, and its label as text.

    `str()` and f-strings show the label, `int()` and comparisons the number.
    """

    label: str

    def __new__(cls, value: int, label: str) -> Choice:
        """The number *value*, called *label*."""
        self = super().__new__(cls, value)
        self.label = label
        return self

    def __str__(self) -> str:
        return self.label

    def __repr__(self) -> str:
        return f"Choice({int(self)}, {self.label!r})"

    def __getnewargs__(self) -> tuple[int, str]:  # type: ignore[override]
        return int(self), self.label


Value = int | float
"""A value in engineering units: float where the drive measures, int where it counts, `Choice` where it names."""


class State(str, Enum):
    """What the drive is doing, from its first status word. It equals its name: `State.STOPPED == "stopped"`."""

    FORWARD = "forward"
    REVERSE = "reverse"
    STOPPED = "stopped"
    FAULT = "fault"
    POWER_OFF = "power_off"
    PRE_EXCITING = "pre_exciting"
    UNKNOWN = "unknown"

    @property
    def running(self) -> bool:
        """Whether the drive feeds the motor in order to turn it."""
        return self in (State.FORWARD, State.REVERSE)

    @property
    def at_rest(self) -> bool:
        """Whether the output to the motor is off. A drive that magnetises the motor before a start is not at rest."""
        return self in (State.STOPPED, State.FAULT, State.POWER_OFF)

    def __str__(self) -> str:
        return self.value.replace("_", " ")

    def __format__(self, form: str) -> str:
        return format(str(self), form)


class ControlSource(str, Enum):
    """Where the drive takes its run command from. It equals its name: `ControlSource.KEYPAD == "keypad"`."""

    KEYPAD = "keypad"
    TERMINAL = "terminal"
    COMMUNICATION = "communication"

    def __str__(self) -> str:
        return self.value

    def __format__(self, form: str) -> str:
        return format(str(self), form)


@dataclass(frozen=True)
class Fault:
    """One fault of a drive.

    Attributes:
        code: The fault's number in the drive.
        mnemonic: What the keypad shows, such as `"OL1"`.
        label: What it means, in words.
        cause: What may have caused it; empty if no manual says so.
        remedy: What to do about it; empty if no manual says so.
        verified: Whether number and meaning were printed for this very family.
        evidence: `"verified"`, `"unverified"` (printed in part or for a sister series) or `"assumed"`.
        note: What else is known about it; says what is missing where it is not verified.
        values: What the drive saw when it tripped, by parameter; a `Snapshot` with units. Empty where it keeps none.
    """

    code: int
    mnemonic: str
    label: str
    cause: str = ""
    remedy: str = ""
    verified: bool = True
    evidence: Evidence = "verified"
    note: str = ""
    values: Mapping[str, Value] = field(default_factory=dict, compare=False)

    def __str__(self) -> str:
        text = f"{self.mnemonic} ({self.code}): {self.label}" if self.mnemonic else f"{self.code}: {self.label}"
        return text if self.verified else f"{text} [unverified]"


@dataclass(frozen=True)
class Status:
    """The state of a drive at one moment.

    What the family's status words do not tell is None.

    Attributes:
        state: What it is doing.
        ready: Whether it could run now.
        source: Where it takes its commands from.
        motor: Which motor's data are in force, 1..4.
        overload_alarm: Whether it warns that a motor overload is near.
        frequency: Output frequency in Hz, without a sign: the state tells the direction.
        setpoint: Set frequency in force, in Hz, without a sign.
        fault: The present fault, or None.
        fields: Every field of the status word in the drive's own words.
        time: Unix time in seconds at which the first of it was asked for; 0.0 where nothing was.
        missing: What is not told here, by attribute, and why.
    """

    state: State
    ready: bool | None
    source: ControlSource | None
    motor: int | None
    overload_alarm: bool | None
    frequency: float | None
    setpoint: float | None
    fault: Fault | None
    fields: Mapping[str, str]
    time: float
    missing: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = ["state not told" if "state" in self.missing else str(self.state)]
        if self.frequency is not None or self.setpoint is not None:
            parts.append(f"{_hertz(self.frequency)} of {_hertz(self.setpoint)} Hz")
        if self.ready is not None:
            parts.append("ready" if self.ready else "not ready")
        if self.source is not None:
            parts.append(f"commands from {self.source}")
        if self.overload_alarm:
            parts.append("overload pre-alarm")
        if self.fault is not None:
            parts.append(f"fault {self.fault}")
        elif "fault" in self.missing:
            parts.append("fault not told")
        return ", ".join(parts)


def _hertz(frequency: float | None) -> str:
    return "?" if frequency is None else f"{frequency:.2f}"


@dataclass(frozen=True)
class ControlItem:
    """One thing that must be set before the drive obeys the bus.

    Attributes:
        code: The parameter, such as `"P00.01"`.
        wanted: The value it needs.
        actual: The value it has; None if it may not be read.
        ok: Whether they are equal.
        verified: Whether a document of this family prints the wanted value.
        label: The parameter in words.
        note: What else is known about it.
    """

    code: str
    wanted: Value
    actual: Value | None
    ok: bool
    verified: bool
    label: str
    note: str = ""


class Control(tuple[ControlItem, ...]):
    """The list that `Drive.check_control` gives: true if every item is as required."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return all(item.ok for item in self)

    def __str__(self) -> str:
        lines = []
        for item in self:
            verdict = "ok" if item.ok else f"needs {int(item.wanted)}"
            unverified = "" if item.verified else " [value unverified]"
            actual = "not read" if item.actual is None else int(item.actual)
            lines.append(f"{item.code} {item.label}: {actual}, {verdict}{unverified}")
        return "\n".join(lines)


@dataclass(frozen=True)
class Description:
    """Everything that is known about one register or parameter.

    Attributes:
        name: Its name, such as `"output_current"`, or its code if it has no other name.
        code: The parameter code, such as `"P00.11"`; None for registers.
        label: What it is, in words.
        kind: `"register"` or `"parameter"`.
        address: Where it is read, 0..0xFFFF; None where nobody knows that, and it cannot be used.
        table: The table it is in: `"holding"`, `"input"`, `"coil"` or `"discrete"`.
        unit: Engineering unit, empty for a plain number.
        scale: Raw counts per unit; no whole number where a share is counted: 163.84 where 16384 counts are 100 %.
        signed: Whether the word is two's complement.
        low, high: Range in engineering units; None where it is not known.
        low_from, high_from: The parameters that narrow the range on a given drive, or None.
        default: Factory value, or None.
        access: `"rw"`, `"ro"`, `"run"` (writable at any time), `"stop"` (only while stopped) or `"unknown"`.
        choices: Labels of the values, empty if they have none.
        bits: Labels of bit fields, or None.
        source: The document that says so.
        verified: Whether documents of this very family print all of it.
        evidence: `"verified"`, `"unverified"` (printed in part or for a sister series) or `"assumed"` (no document of
            the family prints it).
        note: What else is worth knowing; says what is missing where it is not verified.
        words: How many words it takes, 1 or 2.
        variant: What decides its unit, scale and range, such as `"speed_unit"`, or None.
        unverified_bits: Those of *bits* whose place in the word no document of this family prints.
        listed: Whether the profile has a row for it; else only its address is known, which follows from its code.
        high_first: Whether of two words the first is the high one.
    """

    name: str
    code: str | None
    label: str
    kind: Kind
    address: int | None
    unit: str
    scale: int | float
    signed: bool
    low: Any
    high: Any
    low_from: str | None
    high_from: str | None
    default: Any
    access: Access
    choices: Mapping[int, str]
    bits: Mapping[str, Mapping[int, str]] | None
    source: str
    verified: bool
    note: str
    evidence: Evidence = "verified"
    words: int = 1
    variant: str | None = None
    unverified_bits: tuple[str, ...] = ()
    listed: bool = True
    high_first: bool = False
    table: tables.Table = "holding"

    @property
    def place(self) -> int | None:
        """Table and address as one number: of a holding register its address, of a coil 0x1_0000 above it."""
        return None if self.address is None else tables.place(self.table, self.address)

    def number(self, words: Sequence[int]) -> int:
        """What *words* are together, as they stand one behind the other: the raw number that `decode` takes."""
        low_first = reversed(words) if self.high_first else words
        return sum(word << 16 * index for index, word in enumerate(low_first))

    @property
    def reason(self) -> str:
        """Why it is not verified; empty if it is."""
        return "" if self.verified else self.note

    @property
    def writable(self) -> bool:
        """Whether a write makes sense at all."""
        return self.access != "ro"

    @property
    def bounded(self) -> bool:
        """Whether it is known how far its values go, so that a wrong one is noticed here."""
        return self.high is not None or self.high_from is not None or self.variant is not None

    @property
    def group(self) -> str:
        """The group of a parameter, as its code says it; empty for a register."""
        return group_of(self.code or "")

    def text(self, value: Value) -> str:
        """*value* as people read it: with as many digits after the point as the drive counts, or with its label."""
        if isinstance(value, Choice):
            return f"{int(value)} = {value.label}"
        return counted(value, self.scale)


def counted(value: Value, scale: float) -> str:
    """*value* with as many digits after the point as a drive counts that has *scale* counts per unit."""
    if isinstance(value, int):
        return str(int(value))
    shown = f"{value:.{digits_of(scale)}f}"
    return shown if float(shown) == value else repr(value)


def digits_of(scale: float) -> int:
    """How many digits after the point a value has of a drive that has *scale* counts per unit; 9 at most."""
    digits = 0
    while digits < 9 and 10**digits < scale:
        digits += 1
    return digits


def group_of(code: str) -> str:
    """The group that the code of a parameter names: `P05` of P05.06, `C1` of C1-01, `ACC` of ACC."""
    return code.replace("-", ".").partition(".")[0]


@dataclass(frozen=True)
class WatchdogSettings:
    """Which parameters make a drive act by itself when its bus falls silent.

    Attributes:
        timeout: The parameter that holds how long the bus may be silent.
        action: The parameter that holds what the drive then does; None: it trips, and what the fault does to the motor
            is set elsewhere in the drive.
        actions: The value of *action* for each thing it can do: `"coast"`, `"stop"`.
        verified: Whether a document of this very family prints them.
        source: The document that says so.
        note: What else is known; says what is assumed where it is not verified.
        fault: The number of the fault that it trips, or None.
    """

    timeout: str
    action: str | None
    actions: Mapping[str, int]
    verified: bool
    source: str
    note: str = ""
    fault: int | None = None

    @property
    def choices(self) -> tuple[str, ...]:
        """What `Drive.watchdog` can have the drive do: `"coast"`, `"stop"`, or only `"trip"`."""
        return tuple(self.actions) if self.action is not None else ("trip",)


class Snapshot(Named[str, Value]):
    """Values read together: a mapping whose names are attributes too.

    Attributes:
        time: Unix time in seconds at which the first request left.
        duration: Seconds until the last answer was complete.
        units: Engineering unit of each name.
    """

    __slots__ = ("duration", "time", "units")

    def __init__(self, values: Mapping[str, Value], units: Mapping[str, str], time: float, duration: float) -> None:
        super().__init__(values)
        self.units = dict(units)
        self.time = time
        self.duration = duration

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value} {self.units[name]}".rstrip() for name, value in self.items())
        return f"Snapshot({shown})"
