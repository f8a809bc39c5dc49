"""What is asked of a unit: a read or a write, as a value."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import Any, NamedTuple, Protocol, overload

from drivebus import tables

__all__ = ["Ask", "Asks", "Read", "Stamped", "Write", "asking"]


class Read(NamedTuple):
    """A read of words, or of bits.

    Attributes:
        unit: The address of the unit, 1..247.
        address: The first, in its table: 0..0xFFFF.
        count: How many.
        table: Of which table, as `places.TABLES`.
        urgent: Before all who wait for the line.
        verify: Until the same came twice in a row.
        timeout: Seconds that this read alone waits for its answer; None is what the bus has.
        retries: How often this read alone is repeated; None is what the bus has.
    """

    unit: int
    address: int
    count: int = 1  # type: ignore[assignment]  # nobody counts in a read as in a tuple
    table: str = "holding"
    urgent: bool = False
    verify: bool = False
    timeout: float | None = None
    retries: int | None = None

    @classmethod
    def at(cls, unit: int, place: int, count: int = 1, *, urgent: bool = False, verify: bool = False) -> Read:
        """Of *count* from *place* on, which has the table in it."""
        table, address = tables.split(place)
        return cls(unit, address, count, table, urgent, verify)

    def __str__(self) -> str:
        """`read 2 from 2100H on of unit 1, urgent, within 0.1 s, repeated 0 times at most`."""
        place = tables.shown(tables.place(self.table, self.address))
        what = f"read {place}" if self.count == 1 else f"read {self.count} from {place} on"
        how = _how(self) + ", until the same came twice" * self.verify
        how += "" if self.retries is None else f", repeated {self.retries} times at most"
        return f"{what} of unit {self.unit}{how}"


class Write(NamedTuple):
    """A write of words, or of one coil. It is sent once.

    Attributes:
        unit: The address of the unit, 1..247.
        address: The first, in its table: 0..0xFFFF.
        value: A word (06H), or several (10H); of a coil 0 or 1 (05H).
        table: `"holding"` or `"coil"`.
        urgent: Before all who wait for the line, whatever is in doubt.
        read_back: The address where the same can be read: there a confirmation that is missing is looked for, and only
            where the unit shows other words is the write repeated.
        connection: The `reconnects` at which it was seen who answers: at another nothing is sent. None: at any.
        halts: The `halts` of the unit at which this was decided on: where it was told to halt since, nothing is sent.
            None: it is sent in any case, as an urgent one is.
        force: Also what the family does not define.
        timeout: Seconds that this write alone waits for its confirmation; None is what the bus has.
    """

    unit: int
    address: int
    value: int | Sequence[int]
    table: str = "holding"
    urgent: bool = False
    read_back: int | None = None
    connection: int | None = None
    halts: int | None = None
    force: bool = False
    timeout: float | None = None

    def __str__(self) -> str:
        """`write 0005H to 2000H of unit 1, urgent, within 0.1 s`."""
        words = [self.value] if isinstance(self.value, int) else self.value
        what = " ".join(f"{word:04X}H" for word in words)
        how = _how(self) + ", whatever the family defines" * self.force
        return f"write {what} to {tables.shown(tables.place(self.table, self.address))} of unit {self.unit}{how}"


def _how(request: Read | Write) -> str:
    """How *request* is asked, where it is otherwise than its bus asks."""
    within = "" if request.timeout is None else f", within {request.timeout:g} s"
    return ", urgent" * request.urgent + within


class Stamped(NamedTuple):
    """The words that were read, and when, in Unix time: the request had left, and the answer was complete."""

    words: list[int]
    asked: float
    answered: float


Ask = Callable[[Read], Awaitable[list[int]]]
"""Asks a unit for words."""


class Asks(Protocol):
    """Whatever takes a request to its unit, and brings what it answers. Errors as `Requests.read` and `write` have."""

    @overload
    async def ask(self, request: Read, /) -> list[int]: ...
    @overload
    async def ask(self, request: Write, /) -> None: ...
    async def ask(self, request: Read | Write, /) -> list[int] | None:
        """The words that were read; None where they were written."""

    async def ask_stamped(self, request: Read, /) -> Stamped:
        """The words that were read, and when."""


def asking(bus: Asks, **how: Any) -> Ask:
    """What asks *bus*, where each read is to be so as *how* says, in the names of its attributes."""
    return lambda read: bus.ask(read._replace(**how))
