"""What the operations need from the line that a drive hangs on.

They are written against these protocols: they run on a bus, on a stand-in, on anything that behaves like one.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from drivebus.line.asking import Asks

if TYPE_CHECKING:
    from drivebus import _native
    from drivebus.line.stats import Link

__all__ = ["AwaitableBus", "AwaitsHalts", "BusProtocol", "CountsHalts", "KeepsWills"]


class BusProtocol(Protocol):
    """A line with its own clock. All times are seconds."""

    def now(self) -> float:
        """Seconds on the line's clock: real time, or the simulation's."""

    def sleep(self, seconds: float, /) -> None:
        """Waits on the line's clock."""

    def read(
        self,
        unit: int,
        address: int,
        count: int = 1,
        /,
        *,
        urgent: bool = False,
        verify: bool = False,
    ) -> list[int]:
        """Reads words; repeated by the bus's own policy. *urgent* before all who wait; *verify* asks twice."""

    def read_stamped(
        self,
        unit: int,
        address: int,
        count: int = 1,
        /,
        *,
        urgent: bool = False,
        verify: bool = False,
    ) -> tuple[list[int], float, float]:
        """Reads words, with the Unix times of request and answer."""

    def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        /,
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        force: bool = False,
    ) -> None:
        """Writes one word or several; *urgent* before all who wait, whatever is in doubt.

        Sent once. With *read_back*, the address where it can be read, a lost confirmation is cleared up by reading, and
        only where the unit shows another value is the write repeated. With *connection*, nothing is sent where
        `reconnects` is another number by then: PortError. With *force* also what the family does not define.
        """

    def link(self, unit: int, /) -> Link:
        """How many of the last exchanges with *unit*, ten at most, brought an answer."""

    @property
    def reconnects(self) -> int:
        """How often the port was opened again after it was lost."""

    @property
    def closed(self) -> bool:
        """Whether the line was closed for good."""


class AwaitableBus(Asks, Protocol):
    """A bus as the operations know it: it takes requests as values, and is awaited.

    Whatever else an operation awaits is made of them, so that over a bus that blocks nothing is left to wait for.
    """

    def now(self) -> float:
        """See `BusProtocol`, as of all else here."""

    async def sleep(self, seconds: float, /) -> None:
        """See `BusProtocol`."""

    async def link(self, unit: int, /) -> Link:
        """See `BusProtocol`."""

    @property
    def reconnects(self) -> int:
        """See `BusProtocol`."""

    @property
    def closed(self) -> bool:
        """See `BusProtocol`."""

    @property
    def line(self) -> object:
        """What stands for the line: the same for each face of it."""

    def undisturbed(self) -> AbstractContextManager[AwaitableBus]:
        """The same line for a block in which nothing is given up: a cancellation is raised when the block has ended."""

    def blocking(self) -> AwaitableBus:
        """The same line for who has no event loop: it blocks."""


@runtime_checkable
class AwaitsHalts(Protocol):
    """What `CountsHalts` is, of a line that is awaited."""

    async def halts(self, unit: int, /) -> int | None:
        """The number; None where the line behind it does not count them."""


@runtime_checkable
class CountsHalts(Protocol):
    """A line that keeps what was decided on before a stop from being sent after it.

    A bus need not be one: then a stop that comes while a start is under way may be followed by it.
    """

    def halts(self, unit: int, /) -> int:
        """A number that is another one each time *unit* is told to halt. `write` takes it, as `halts`."""


@runtime_checkable
class KeepsWills(Protocol):
    """A line with whose owner a program can leave what halts a unit, should it be gone without a word.

    A bus need not be one: then nobody is left to halt what a program ran that was killed.
    """

    @property
    def port(self) -> str:
        """The name of the port."""

    def leave_will(
        self,
        unit: int,
        ways: Sequence[Sequence[bytes]],
        /,
        *,
        look: tuple[bytes, Sequence[bytes]] | None = None,
        silence: float = 0.0,
        named: tuple[_native.Profile, Sequence[str], bool, bool] | None = None,
    ) -> int | None:
        """Leaves it: the number of the will, or None where nobody would find it.

        *ways* are requests, as PDUs, each a way to halt; *look* is a read that goes before, and the answers to it by
        which another unit gives itself away; *silence* is the drive's own time-out, in seconds.
        *named* is as what the unit is halted instead, where its family is a shipped one: its profile, the commands,
        whether its name is trusted, and whether what is not verified is done.
        """

    def withdraw_will(self, number: int, /) -> None:
        """Takes the will with this number back."""
