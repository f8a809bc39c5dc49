"""What a profile tells of a family as a whole: frozen, and a mapping of its own attributes as well."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

__all__ = [
    "Alias",
    "FactorySerial",
    "IdentificationCode",
    "Memory",
    "RequestRules",
    "Setting",
    "StartStep",
    "Variant",
]


class _Fact(Mapping[str, Any]):
    """A mapping of its own attributes."""

    __slots__ = ()

    def __getitem__(self, name: str) -> Any:
        if name in self._names():
            return getattr(self, name)
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def _names(self) -> list[str]:
        return [field.name for field in fields(self)]  # type: ignore[arg-type]  # each kind is a dataclass


@dataclass(frozen=True, slots=True)
class Alias(_Fact):
    """A drive under another name that has the registers and commands of a family.

    Attributes:
        name: Its maker and its name, such as `"Huanyang GT"`.
        note: How much of the family is known of it.
        source: Who says so.
    """

    name: str
    note: str
    source: str


@dataclass(frozen=True, slots=True)
class RequestRules(_Fact):
    """What is known of requests beside their length.

    Attributes:
        protocol: `"modbus"`, or `"huanyang"`: that maker's own, of which each register stands for something.
        max_written: Most words in one write.
        joined: Where it is printed that one 10H request may write several parameters; None where it is not.
        across_groups: Whether a read may leave its group of parameters.
        single_parameters: Whether a read may have one parameter and no more.
        zeros: The high bytes of addresses under which each is answered, with 0 where there is nothing.
        absent: A word that the drive has where it has nothing; None where it has none.
        verified: Whether a document of this very family prints it.
        note: What else is known; says what is assumed where it is not verified.
        source: The document that says so.
    """

    protocol: str
    max_written: int
    joined: str | None
    across_groups: bool
    single_parameters: bool
    zeros: tuple[int, ...]
    absent: int | None
    verified: bool
    note: str
    source: str


@dataclass(frozen=True, slots=True)
class FactorySerial(_Fact):
    """How the factory sets the line.

    Attributes:
        baud_rate: Bits per second.
        format: Data bits, parity and stop bits: `"8E1"`.
        unit: The address, 1..247; None where it is not printed.
        response_delay: Seconds that a drive waits before it answers.
        verified: Whether a document of this very family prints it.
        source: The document that says so.
    """

    baud_rate: int
    format: str
    unit: int | None
    response_delay: float
    verified: bool
    source: str


@dataclass(frozen=True, slots=True)
class StartStep(_Fact):
    """A word that comes before one that runs or jogs a motor at rest.

    Attributes:
        word: The word.
        label: What it is called.
        until: Fields of the state word, and what they must be before the next word is sent.
        mask: The bits of those fields.
        value: What those bits must be.
    """

    word: int
    label: str
    until: Mapping[str, int]
    mask: int
    value: int


@dataclass(frozen=True, slots=True)
class Memory(_Fact):
    """Where a parameter that is written is kept.

    Attributes:
        bit: The bit of the address that decides it, 0..15; None where a word stores what was written.
        means: What a write with that bit reaches: `"ram"`, only that; `"eeprom"`, that too. `"store"`: what is written
            stays in RAM until *store_word*, written to *store_register*, stores all that was set, by whomever.
        store_register: Where that word goes; None where a bit decides.
        store_word: The word; None where a bit decides.
        reason: Why this is not verified; None where it is.
        source: The document that says so.
    """

    bit: int | None
    means: str
    store_register: str | None
    store_word: int | None
    reason: str | None
    source: str


@dataclass(frozen=True, slots=True)
class Setting(_Fact):
    """A parameter that has to have a value before the drive obeys the bus, or takes a setpoint.

    Attributes:
        code: The parameter, or the name of a register.
        bits: The highest and the lowest of the bits that count; None where all do.
        value: The word that it must hold, or what those bits must.
        label: What it is called.
        always: Whether it is looked at before each start.
        by_hand: Whether `Drive.prepare_control` leaves it alone.
        verified: Whether a document of this very family prints it.
        note: What else is known; says what is assumed where it is not verified.
        source: The document that says so.
    """

    code: str
    bits: tuple[int, int] | None
    value: int
    label: str
    always: bool
    by_hand: bool
    verified: bool
    note: str
    source: str


@dataclass(frozen=True, slots=True)
class Variant(_Fact):
    """A parameter that decides what some registers mean.

    Attributes:
        parameter: The parameter.
        choices: What it may decide, by name, and the word of the parameter for each; none where it is a share.
        between: Where registers count a share of what the parameter says: the least and the most that this may be, as
            texts that `variants` takes, `("1 Hz", "599 Hz")`. Else None.
        reason: Why those words are not verified; None where they are.
        source: The document that says so.
    """

    parameter: str
    choices: Mapping[str, int]
    between: tuple[str, str] | None
    reason: str | None
    source: str


@dataclass(frozen=True, slots=True)
class IdentificationCode(_Fact):
    """A code by which units say what they are.

    Attributes:
        code: The code, 0..0xFFFF.
        family: The family that reports it.
        title: What that is called.
        shared: What else reports it.
        verified: Whether a document prints it.
        note: What else is known; says what is assumed where it is not verified.
        source: The document that says so.
    """

    code: int
    family: str
    title: str
    shared: tuple[str, ...]
    verified: bool
    note: str
    source: str
