"""A halt on its way: sent until the unit takes it, one frame after another, for as long as was said; and then proved.

What is sent, and what proves it, is decided in the core (`crates/drive`); here it finds its line, and its records.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from drivebus import _native
from drivebus.errors import DrivebusError
from drivebus.line.tasks import carried_out
from drivebus.operations import glances
from drivebus.operations.core_calls import hear
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import explained
from drivebus.operations.not_halted import in_words
from drivebus.profile import Profile

__all__ = ["WITHIN", "Halt", "halt_all"]

WITHIN = _native.HALT_WITHIN
"""Seconds for which a halt is sent that is not taken."""


class Halt:
    """One unit that is to be halted.

    Args:
        unit: The unit, as it was named.
        command: What is sent.
        confirm: Seconds for which its state is looked at; 0 does not look.
        within: Seconds for which it is sent until the unit takes it.
        coasts: Whether each fourth frame is a coast.
    """

    def __init__(self, unit: DriveView, command: str, confirm: float, within: float, *, coasts: bool = False) -> None:
        self.unit = unit
        self._taken_for: dict[str, DriveView] = {unit.profile.name: unit}
        looks = glances.planned(unit.evidence).looks
        same, sent = unit.identity.seen_as(unit.profile), unit.record.sent
        self.core = _native.Halt(same, looks, sent, command, coasts, within, confirm)

    async def carry_out(self) -> None:
        """Does all of it.

        Raises:
            NotAllowed: What the unit is cannot be told, and the command might start it. It was not sent.
            Refused, NoAnswer, BadAnswer, PortError: Nothing was taken within the time.
            Unconfirmed: It went out, and is not proved: the motor may still turn.
        """
        kind, told = await _done(self.core.carry_out(), [self])
        if kind != "done":
            raise self.failure(*told)

    def failure(self, family: str, *reason: Any) -> DrivebusError:
        """Why the unit, taken for one of *family*, is not known to be halted."""
        return in_words(self.unit, self.taken_for(family), *reason)

    def taken_for(self, family: str) -> DriveView:
        """The unit as one of *family*: of a name that it shares with a shipped one, the named one is meant."""
        if family not in self._taken_for:
            self._taken_for[family] = self.unit.taken_for(Profile.builtin(family))
        return self._taken_for[family]


async def halt_all(halts: Sequence[Halt]) -> list[DrivebusError | None]:
    """Carries out *halts* of units on one line, side by side. Of each why it is not known to be halted, or None."""
    done = await _done(_native.halt_all([halt.core for halt in halts]), halts)
    return [None if kind == "done" else halt.failure(*told) for halt, (kind, told) in zip(halts, done, strict=True)]


async def _done(task: _native.Task, halts: Sequence[Halt]) -> Any:
    """What *task* of *halts* comes to, in the words of what each unit is taken for."""
    of_unit = {halt.unit.address: halt for halt in halts}

    def taken() -> DriveView | None:
        if task.taken_for is None:
            return None
        unit, family = task.taken_for
        return of_unit[unit].taken_for(family)

    def around() -> AbstractContextManager[None]:
        unit = taken()
        return nullcontext() if unit is None else explained(unit)

    def hears(kind: str, told: Any) -> None:
        unit = taken()
        if unit is not None:
            hear(unit, kind, told)

    return await carried_out(task, halts[0].unit.bus, around, hears)
