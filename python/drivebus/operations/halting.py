"""A halt on its way: sent until the unit takes it, one frame after another, for as long as was said; and then proved.

What is sent, and what proves it, is decided in the core (`crates/drive`); here it finds its line, and its records.
"""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Any

from drivebus import _native
from drivebus.line.tasks import carried_out
from drivebus.operations import glances
from drivebus.operations.core_calls import hear
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import explained
from drivebus.operations.not_halted import in_words
from drivebus.profile import Profile

__all__ = ["WITHIN", "Halt"]

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
        self._unit = unit
        self._taken_for: dict[str, DriveView] = {unit.profile.name: unit}
        looks = glances.planned(unit.evidence).looks
        same, sent = unit.identity.seen_as(unit.profile), unit.record.sent
        self._halt = _native.Halt(same, looks, sent, command, coasts, within, confirm, unit.bus.now())

    async def carry_out(self) -> None:
        """Does all of it.

        Raises:
            NotAllowed: What the unit is cannot be told, and the command might start it. It was not sent.
            Refused, NoAnswer, BadAnswer, PortError: Nothing was taken within the time.
            Unconfirmed: It went out, and is not proved: the motor may still turn.
        """
        await self._done(self._halt.carry_out())

    async def advance(self) -> bool:
        """Does the next thing of it: sends, asks what the unit is, or looks. Whether nothing is left to be done.

        Raises:
            NotAllowed, Refused, NoAnswer, BadAnswer, PortError, Unconfirmed: As for `carry_out`.
        """
        return await self._done(self._halt.advance())

    @property
    def pause(self) -> float:
        """Seconds until there is something to do again."""
        return self._halt.pause(self._unit.bus.now())

    def wait(self, seconds: float) -> None:
        """For *seconds* others were seen to: its proof does not count them."""
        self._halt.wait(seconds)

    async def _done(self, task: _native.Task) -> bool:
        def around() -> AbstractContextManager[None]:
            return nullcontext() if task.family is None else explained(self._as(task.family))

        def hears(kind: str, told: Any) -> None:
            unit = self._unit if task.family is None else self._as(task.family)
            hear(unit, kind, told)

        kind, told = await carried_out(task, self._unit.bus, around, hears)
        if kind == "not_halted":
            family, *reason = told
            raise in_words(self._unit, self._as(family), *reason)
        is_done: bool = told
        return is_done

    def _as(self, family: str) -> DriveView:
        """The unit as one of *family*: of a name that it shares with a shipped one, the named one is meant."""
        if family not in self._taken_for:
            self._taken_for[family] = self._unit.taken_for(Profile.builtin(family))
        return self._taken_for[family]
