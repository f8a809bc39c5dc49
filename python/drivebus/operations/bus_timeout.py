"""The communication time-out of a drive: what it does by itself when it hears nothing, set and given back.

What keeps it from running out meanwhile is a thread in `drivebus.watchdog`, and a task in `drivebus.aio.watchdog`.
"""

from __future__ import annotations

import math
from contextlib import suppress

from drivebus import checks
from drivebus._native import FALL_PATIENCE
from drivebus.errors import BadArgument, DrivebusError, Unconfirmed
from drivebus.operations import parameters, registers, speed, state
from drivebus.operations.drive_view import DriveView
from drivebus.operations.glances import POLL_INTERVAL
from drivebus.operations.in_parts import counted
from drivebus.operations.last_will import LastWill
from drivebus.profile.evidence import not_verified
from drivebus.values import Value

__all__ = ["BusTimeout"]

_READS_PER_TIMEOUT = 4
"""How often the drive is asked within its time-out: three answers may be lost before it acts."""


class BusTimeout:
    """What is set in the drive, and what it had before.

    Attributes:
        timeout: Seconds of silence after which the drive acts.
        action: What it then does: `"coast"`, `"stop"` or `"trip"`.
        verified: Whether a document of this very family prints the parameters and their values.
        armed: Whether the drive acts by itself when it hears nothing. True after `close` where the motor still turned
            or could not be asked.
        error: What the last failure of keeping the line busy was, or of closing; None if there was none.
        unsure: What cannot be promised, in words; empty where nothing is known that speaks against it. Each request of
            anybody keeps the drive from acting by itself. On a serial port, whoever has it when this program is gone
            halts the drive before anything else goes there. Through a gateway (`tcp://`) nobody does. Behind a serial
            server (`socket://`) another computer may ask the drive, of which nothing is known here.
    """

    timeout: float
    action: str
    verified: bool
    armed: bool
    unsure: str
    error: DrivebusError | None

    def __init__(self, drive: DriveView, timeout: float, action: str) -> None:
        settings = drive.profile.watchdog
        if settings is None:
            raise BadArgument(
                f"{drive.profile.title} has no communication time-out that is known; nothing was sent",
                unit=drive.address,
            )
        if drive.profile.memory() is None:
            raise BadArgument(
                f"no way to write {settings.timeout} of {drive.profile.title} to RAM alone is known, and a watchdog "
                "must not wear the EEPROM each time; nothing was sent. Set the time-out in the drive, for good",
                unit=drive.address,
            )
        if not (settings.verified or drive.unverified):
            parameters_of_it = ", ".join(filter(None, (settings.timeout, settings.action)))
            what = f"the communication time-out of {drive.profile.title} ({parameters_of_it})"
            raise not_verified(what, settings.note, drive.address)
        high = drive.profile.describe(settings.timeout).high
        self.timeout = checks.number("timeout", timeout, 0.0, math.inf if high is None else high, above=True)
        self.action = checks.one_of("action", action, settings.choices)
        self.verified = settings.verified
        self.armed = False
        self.unsure = ""
        self.error = None
        self._will = LastWill(drive, self.timeout, "coast" if self.action == "coast" else "stop")
        self._unit = drive
        # The action comes first: a time-out must not run out on another one.
        self._wanted: dict[str, Value] = {}
        if settings.action is not None:
            self._wanted[settings.action] = settings.actions[self.action]
        self._wanted[settings.timeout] = self.timeout
        for name, value in self._wanted.items():
            drive.profile.encode(name, value)
        # The time-out goes back first, for the same reason.
        self._former: dict[str, Value] = dict.fromkeys(reversed(self._wanted), 0)

    @property
    def interval(self) -> float:
        """Seconds between two questions that keep the line busy."""
        return self.timeout / _READS_PER_TIMEOUT

    async def set(self) -> None:
        """Sets them, and reads them back."""
        former = await registers.snapshot(self._unit, *self._former)
        self._former = {name: former[name] for name in self._former}
        try:
            with counted(self._unit) as unit:
                await parameters.write(unit, self._wanted)
                shown = await registers.snapshot(unit, *self._wanted)
        except BaseException as error:
            # Ctrl-C as well. It may have taken a part. If it cannot be told to forget that, it acts: nobody keeps the
            # line busy.
            with suppress(DrivebusError):
                await self._put_back()
                if isinstance(error, DrivebusError):
                    error.in_part = False
            raise
        encode = self._unit.profile.encode
        if any(encode(name, shown[name]) != encode(name, value) for name, value in self._wanted.items()):
            await self._put_back()
            raise Unconfirmed(
                f"unit {self._unit.address} took {self._wanted} for its watchdog and shows {shown!r}; it has back what "
                "it had",
                unit=self._unit.address,
            )
        self.armed = True
        self._will.leave()
        self.unsure = self._will.unsure()

    async def give_back(self) -> None:
        """Waits for a motor that slows down, and gives the drive the settings it had. A failure is kept in `error`."""
        try:
            if await self._comes_to_rest():
                await self._put_back()
        except DrivebusError as error:
            self.error = error

    async def ask(self) -> bool:
        """Keeps the drive from acting for now. Whether that makes sense again: not on a line that was closed."""
        try:
            await state.ping(self._unit)
        except DrivebusError as error:
            self.error = error
            return not self._unit.bus.closed
        return True

    async def _put_back(self) -> None:
        with self._unit.bus.undisturbed() as bus:
            await parameters.write(self._unit.with_bus(bus), self._former)
            self.armed = False
            self._will.withdraw()

    async def _comes_to_rest(self) -> bool:
        """Whether the motor is stopped, once it no longer slows down."""
        bus = self._unit.bus
        lowest, deadline = math.inf, bus.now()
        while True:
            seen = await state.state(self._unit)
            if seen.at_rest and not await speed.turns_in_spite_of(self._unit, seen):
                return True
            frequency = await speed.output_frequency(self._unit)
            now = bus.now()
            if frequency is not None and frequency < lowest:
                lowest, deadline = frequency, now + FALL_PATIENCE
            elif now >= deadline:
                return False
            await bus.sleep(POLL_INTERVAL)

    def __repr__(self) -> str:
        now = "armed" if self.armed else "off"
        unverified = "" if self.verified else ", its parameters unverified"
        failed = f", failed last with: {self.error}" if self.error else ""
        what = f"{self.action} after {self.timeout:g} s"
        unsure = f"; {self.unsure}" if self.unsure else ""
        return f"<Watchdog of unit {self._unit.address}: {what}, {now}{unverified}{failed}{unsure}>"
