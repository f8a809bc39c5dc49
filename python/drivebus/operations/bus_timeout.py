"""The communication time-out of a drive: what it does by itself when it hears nothing, set and given back.

What keeps it from running out meanwhile is a thread in `drivebus.watchdog`, and a task in `drivebus.aio.watchdog`.
"""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from drivebus import _native, checks
from drivebus.errors import BadArgument, DrivebusError, NotAllowed, Unconfirmed
from drivebus.operations import not_kept, state, unit_variants
from drivebus.operations.core_calls import call_core
from drivebus.operations.drive_view import DriveView
from drivebus.operations.in_parts import counted
from drivebus.operations.last_will import LastWill
from drivebus.profile.evidence import not_verified, refusal_of
from drivebus.profile.profile import native_of

__all__ = ["BusTimeout"]


class BusTimeout:
    """What is set in the drive, and what it had before.

    Attributes:
        timeout: Seconds of silence after which the drive acts.
        action: What it then does: `"coast"`, `"stop"` or `"trip"`.
        verified: Whether a document of this very family prints the parameters and their values.
        error: What the last failure of keeping the line busy was, or of closing; None if there was none.
        unsure: What cannot be promised, in words; empty where nothing is known that speaks against it. Each request of
            anybody keeps the drive from acting by itself. On a serial port, whoever has it when this program is gone
            halts the drive before anything else goes there. Through a gateway (`tcp://`) nobody does. Behind a serial
            server (`socket://`) another computer may ask the drive, of which nothing is known here.
    """

    timeout: float
    action: str
    verified: bool
    unsure: str
    error: DrivebusError | None

    def __init__(self, drive: DriveView, timeout: float, action: str) -> None:
        rule = _native.Rule(native_of(drive.profile), drive.unverified)
        kind, told = _native.BusTimeout.of(rule, timeout, action)
        if kind != "done":
            raise _not_armable(drive, kind, told, timeout, action)
        settings = drive.profile.watchdog
        self._core: _native.BusTimeout = told
        self.timeout = self._core.seconds
        self.action = self._core.action
        self.verified = settings is not None and settings.verified
        self.unsure = ""
        self.error = None
        self._will = LastWill(drive, self.timeout, "coast" if self.action == "coast" else "stop")
        self._unit = drive

    @property
    def armed(self) -> bool:
        """Whether the drive acts by itself when it hears nothing.

        True after `close` where the motor still turned or could not be asked.
        """
        return self._core.is_armed

    @property
    def interval(self) -> float:
        """Seconds between two questions that keep the line busy."""
        return self._core.interval

    async def set(self) -> None:
        """Sets it in the drive, and reads it back. Where that fails, the drive gets back what it had."""
        try:
            kind, told = await call_core(self._unit, self._core.set)
        except BaseException:
            # Ctrl-C as well. It may have taken a part. If it cannot be told to forget that, it acts: nobody keeps the
            # line busy.
            if self._core.may_be_set:
                with suppress(DrivebusError):
                    await self._put_back()
            raise
        if kind != "done":
            raise self._not_armed(*told)
        self._will.leave()
        self.unsure = self._will.unsure()

    async def give_back(self) -> None:
        """Waits for a motor that slows down, and gives the drive the settings it had. A failure is kept in `error`."""
        try:
            kind, rests = await call_core(self._unit, lambda core: core.comes_to_rest())
            if kind != "done":
                raise refusal_of(state.state_word, self._unit, "telling the state")
            if rests:
                await self._put_back()
        except DrivebusError as error:
            self.error = error

    async def ask(self) -> bool:
        """Keeps the drive from acting for now. Whether that makes sense again: not on a line that was closed."""
        kind, told = await call_core(self._unit, self._core.ask)
        if kind == "done":
            return True
        error, is_over = told
        self.error = error or state.nothing_to_ask(self._unit)
        return not is_over

    async def _put_back(self) -> None:
        with self._unit.bus.undisturbed() as bus, counted(self._unit.with_bus(bus)) as unit:
            kind, told = await call_core(unit, self._core.put_back)
            if kind != "done":
                raise self._not_kept(*told)
            self._will.withdraw()

    def _not_armed(
        self, kind: str, told: Any, in_part: bool, not_back: tuple[list[str], str, Any] | None
    ) -> DrivebusError:
        """Why it is not set; *not_back* is why the drive has not back what it had."""
        error: DrivebusError
        if kind == "not_kept":
            error = self._not_kept(*told)
        elif kind == "may_not":
            error = refusal_of(self._unit.evidence.require_readable, [told])
        elif kind == "not_settled":
            error = unit_variants.not_settled(self._unit, *told)
        elif kind == "failed":
            error = told
        elif not_back is None:
            shown = ", ".join(f"{name} = {value:g} {counted_in}".rstrip() for name, value, counted_in in told)
            error = Unconfirmed(
                f"unit {self._unit.address} took {self.action} after {self.timeout:g} s for its watchdog, and shows "
                f"{shown}; it has back what it had",
                unit=self._unit.address,
            )
        else:
            error = self._not_kept(*not_back)
        error.in_part = in_part
        return error

    def _not_kept(self, done: list[str], kind: str, told: Any) -> DrivebusError:
        error = not_kept.in_words(self._unit, kind, told)
        return not_kept.written_before(error, done)

    def __repr__(self) -> str:
        now = "armed" if self.armed else "off"
        unverified = "" if self.verified else ", its parameters unverified"
        failed = f", failed last with: {self.error}" if self.error else ""
        what = f"{self.action} after {self.timeout:g} s"
        unsure = f"; {self.unsure}" if self.unsure else ""
        return f"<Watchdog of unit {self._unit.address}: {what}, {now}{unverified}{failed}{unsure}>"


def _not_armable(unit: DriveView, kind: str, told: Any, timeout: object, action: object) -> NotAllowed:
    """Why nothing of it may be set, of which the core *told*."""
    settings, title = unit.profile.watchdog, unit.profile.title
    if settings is None:
        return BadArgument(
            f"{title} has no communication time-out that is known; nothing was sent",
            unit=unit.address,
        )
    if kind == "only_stored":
        return BadArgument(
            f"no way to write {settings.timeout} of {title} to RAM alone is known, and a watchdog must not wear the "
            "EEPROM each time; nothing was sent. Set the time-out in the drive, for good",
            unit=unit.address,
        )
    if kind == "not_printed":
        parameters = ", ".join(filter(None, (settings.timeout, settings.action)))
        return not_verified(f"the communication time-out of {title} ({parameters})", settings.note, unit.address)
    if kind == "out_of_range":
        return refusal_of(checks.number, "timeout", timeout, 0.0, math.inf if told is None else told, above=True)
    return refusal_of(checks.one_of, "action", action, settings.choices)
