"""What a drive needs from the line it hangs on and from the profile of its family.

`Drive` is written against these protocols: it runs on a bus, on a stand-in, on anything that behaves like one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Protocol

from drivebus.figures import Link
from drivebus.values import Description, Fault, Value, WatchdogSettings

__all__ = ["AwaitableBus", "BusProtocol", "PlanProtocol", "ProfileProtocol"]


class BusProtocol(Protocol):
    """A line with its own clock. All times are seconds."""

    def now(self) -> float:
        """Seconds on the line's clock: real time, or the simulation's."""

    def sleep(self, seconds: float, /) -> None:
        """Waits on the line's clock."""

    def read(
        self, unit: int, address: int, count: int = 1, /, *, urgent: bool = False, verify: bool = False
    ) -> list[int]:
        """Reads words; repeated by the bus's own policy. *urgent* before all who wait; *verify* asks twice."""

    def read_stamped(
        self, unit: int, address: int, count: int = 1, /, *, urgent: bool = False, verify: bool = False
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


class AwaitableBus(Protocol):
    """A bus as the operations know it: the same calls, to be awaited.

    Whatever else an operation awaits is made of them, so that over a bus that blocks nothing is left to wait for.
    """

    def now(self) -> float:
        """See `BusProtocol`, as of all else here."""

    async def sleep(self, seconds: float, /) -> None:
        """See `BusProtocol`."""

    async def read(
        self, unit: int, address: int, count: int = 1, /, *, urgent: bool = False, verify: bool = False
    ) -> list[int]:
        """See `BusProtocol`."""

    async def read_stamped(
        self, unit: int, address: int, count: int = 1, /, *, urgent: bool = False, verify: bool = False
    ) -> tuple[list[int], float, float]:
        """See `BusProtocol`."""

    async def write(
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


class PlanProtocol(Protocol):
    """What to read for some names, and what the words mean."""

    @property
    def names(self) -> Sequence[str]:
        """As they were asked for."""

    @property
    def reads(self) -> Sequence[tuple[int, int]]:
        """Address and number of words of each read."""

    @property
    def units(self) -> Mapping[str, str]:
        """The engineering unit of each name."""

    def values(self, answers: Sequence[Sequence[int]], /) -> list[Value]:
        """The value of each name out of the words that each read brought."""


class ProfileProtocol(Protocol):
    """What one family of drives means by its words."""

    @property
    def name(self) -> str:
        """The profile, such as `"gd350"`."""

    @property
    def family(self) -> str:
        """The family: its own name, or for an overlay that of the profile below it."""

    @property
    def title(self) -> str:
        """The family as its maker calls it."""

    @property
    def functions(self) -> Sequence[int]:
        """The function codes that the drive takes."""

    def names(self) -> list[str]:
        """Every register name and parameter code."""

    def name_at(self, address: int, /) -> str | None:
        """The register or parameter at *address*, or None."""

    def monitor_names(self) -> list[str]:
        """The registers worth watching."""

    def role(self, what: str, /) -> str | None:
        """The register for `"state"`, `"fault"`, `"frequency"`, `"setpoints.torque"` …, if the family has one."""

    @property
    def status_words(self) -> Sequence[str]:
        """The words whose bit fields tell more of the state."""

    def describe(self, name: str, /) -> Description:
        """All that is known of one register or parameter."""

    def address(self, name: str, /, *, store: bool | None = None) -> int:
        """Where *name* is read, or written to RAM (*store* False) or EEPROM (*store* True)."""

    def memory(self) -> dict[str, Any] | None:
        """How an address tells RAM from EEPROM: `bit`, `means`, `reason`. None where it does not."""

    def read_back(self, name: str, /) -> int | None:
        """Where what was written to *name* can be read; None where that would not tell whether the drive took it."""

    def decode(self, name: str, raw: int, /) -> int | float:
        """A word in engineering units."""

    def encode(self, name: str, value: object, /) -> int:
        """Engineering units as a word."""

    def fields(self, name: str, raw: int, /) -> dict[str, str]:
        """The bit fields of a word, each with its meaning."""

    def compile(self, names: Sequence[str], /) -> PlanProtocol:
        """The fewest reads that hold all *names*, and the way from their words to values."""

    @property
    def command_address(self) -> int | None:
        """Where commands are written, if the family has such a register."""

    def command(self, name: str, /) -> tuple[int, int]:
        """Address and code of a command."""

    def commands(self) -> dict[str, int]:
        """The code of each command that the family has, verified or not."""

    def command_reason(self, name: str, /) -> str | None:
        """Why a command may not be given unless it is said that it may; None if it may."""

    def command_codes(self) -> dict[int, str]:
        """Every code that the family defines, with or without a method of ours."""

    def is_command(self, address: int, /) -> bool:
        """Whether a write to *address* can move a motor."""

    def state(self, raw: int, /) -> str:
        """The first status word by name."""

    def is_in_fault(self, raw: int, /) -> bool:
        """Whether the first status word says that the drive is in fault, which it may run in."""

    def state_reason(self) -> str | None:
        """Why the states may not be used unless it is said that they may; None if they may."""

    def control(self) -> list[dict[str, Any]]:
        """What must be set before the drive obeys the bus."""

    def setpoint_names(self) -> list[str]:
        """What the drive can be told besides commands, such as `"frequency"` and `"torque"`."""

    def needs(self, setpoint: str, /) -> list[dict[str, Any]]:
        """What must be set before the drive heeds a setpoint."""

    def variants(self) -> dict[str, dict[str, Any]]:
        """What a parameter of the drive decides of the meaning of registers: `parameter`, `choices`, `reason`."""

    @property
    def variants_chosen(self) -> Mapping[str, str]:
        """Which of the variants are fixed, and how."""

    def with_variants(self, chosen: Mapping[str, str]) -> ProfileProtocol:
        """The same family with variants fixed."""

    def reports_as(self) -> list[str]:
        """The families whose identification codes a unit may report, its own first."""

    def identifications(self) -> list[dict[str, Any]]:
        """The identification codes that are listed: `code`, `family`, `title`, `shared`."""

    def signature(self) -> dict[str, list[int]] | None:
        """The words that a unit of this family `answers`, and those it `refuses`, where it has no code."""

    def fault(self, code: int, /) -> Fault:
        """One fault by its number."""

    def exception(self, code: int, /) -> tuple[str, str]:
        """Name and meaning of an exception code in this family."""

    def faults(self) -> list[Fault]:
        """Every fault that is known, by number."""

    @property
    def watchdog(self) -> WatchdogSettings | None:
        """What makes the drive act by itself when its bus falls silent, if it has such a thing."""

    @property
    def fault_history(self) -> Sequence[str]:
        """The parameters that hold the last faults, the latest first."""

    @property
    def fault_values(self) -> Sequence[str]:
        """The parameters that hold what the drive saw when it tripped last."""

    @property
    def version(self) -> int:
        """The version of the profile."""

    def acts(self) -> list[str]:
        """The parameters whose write does something, such as tuning the motor."""

    def serial_parameters(self) -> list[str]:
        """The parameters that hold the settings of the serial line."""

    def motor_parameters(self) -> list[str]:
        """The parameters that hold the data of the motor."""

    def last_parameters(self) -> list[str]:
        """The parameters that are written after all others, in this order."""
