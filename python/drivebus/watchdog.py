"""A drive that acts by itself when it hears nothing: what helps when the program is killed or the cable is cut.

The drive has a communication time-out and an action of its own. They are set in RAM, the line is kept busy, and when
that ends for whatever reason, the drive does what it was told. What is asked of the drive stands in `Settings`; what
keeps the line busy is a thread here, and a task in `drivebus.aio`.
"""

from __future__ import annotations

import atexit
import math
import threading
from contextlib import suppress
from types import TracebackType

from drivebus import checks
from drivebus.errors import DrivebusError, NotAllowed, Unconfirmed
from drivebus.line.blocking import at_once
from drivebus.operations.commands import POLL_INTERVAL
from drivebus.operations.motion import Motion
from drivebus.operations.ramp import PATIENCE
from drivebus.profile.evidence import not_verified
from drivebus.values import Value

__all__ = ["Settings", "Watchdog"]

_READS_PER_TIMEOUT = 4
"""How often the drive is asked within its time-out: three answers may be lost before it acts."""


class Settings:
    """What is set in the drive, and what it had before.

    Attributes:
        timeout: Seconds of silence after which the drive acts.
        action: What it then does: `"coast"` or `"stop"`.
        verified: Whether a document of this very family prints the parameters and their values.
        armed: Whether the drive acts by itself when it hears nothing. True after `close` where the motor still turned
            or could not be asked.
        error: What the last failure of keeping the line busy was, or of closing; None if there was none.
    """

    def __init__(self, drive: Motion, timeout: float, action: str) -> None:
        settings = drive.profile.watchdog
        if settings is None:
            raise NotAllowed(
                f"{drive.profile.title} has no communication time-out that is known; nothing was sent", unit=drive.unit
            )
        if drive.profile.memory() is None:
            raise NotAllowed(
                f"no way to write {settings.timeout} of {drive.profile.title} to RAM alone is known, and a watchdog "
                "that wears EEPROM each time is none; nothing was sent. Set the time-out in the drive, for good",
                unit=drive.unit,
            )
        if not (settings.verified or drive.unverified):
            what = f"the communication time-out of {drive.profile.title} ({settings.timeout}, {settings.action})"
            raise not_verified(what, settings.note, drive.unit)
        high = drive.profile.describe(settings.timeout).high
        self.timeout = checks.number("timeout", timeout, 0.0, math.inf if high is None else high, above=True)
        self.action = checks.one_of("action", action, list(settings.actions))
        self.verified = settings.verified
        self.armed = False
        self.error: DrivebusError | None = None
        self._drive = drive
        # The action comes first: a time-out must not run out on another one.
        self._wanted: dict[str, Value] = {
            settings.action: settings.actions[self.action],
            settings.timeout: self.timeout,
        }
        for name, value in self._wanted.items():
            drive.profile.encode(name, value)
        # The time-out goes back first, for the same reason.
        self._former: dict[str, Value] = dict.fromkeys((settings.timeout, settings.action), 0)

    @property
    def interval(self) -> float:
        """Seconds between two questions that keep the line busy."""
        return self.timeout / _READS_PER_TIMEOUT

    async def set(self) -> None:
        """Sets them, and reads them back."""
        former = await self._drive.snapshot(*self._former)
        self._former = {name: former[name] for name in self._former}
        try:
            await self._drive.write(self._wanted)
            shown = await self._drive.snapshot(*self._wanted)
        except BaseException:
            # Ctrl-C as well. It may have taken a part. If it cannot be told to forget that, it acts: nobody keeps the
            # line busy.
            with suppress(DrivebusError):
                await self._put_back()
            raise
        encode = self._drive.profile.encode
        if any(encode(name, shown[name]) != encode(name, value) for name, value in self._wanted.items()):
            await self._put_back()
            raise Unconfirmed(
                f"unit {self._drive.unit} took {self._wanted} for its watchdog and shows {shown!r}; it has back what "
                "it had",
                unit=self._drive.unit,
            )
        self.armed = True

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
            await self._drive.ping()
        except DrivebusError as error:
            self.error = error
            return not self._drive.bus.closed
        return True

    async def _put_back(self) -> None:
        with self._drive.bus.undisturbed() as bus:
            await self._drive.over(bus).write(self._former)
            self.armed = False

    async def _comes_to_rest(self) -> bool:
        """Whether the motor is stopped, once it no longer slows down."""
        bus = self._drive.bus
        lowest, deadline = math.inf, bus.now()
        while not (await self._drive.state()).at_rest:
            frequency = await self._drive.output_frequency()
            now = bus.now()
            if frequency is not None and frequency < lowest:
                lowest, deadline = frequency, now + PATIENCE
            elif now >= deadline:
                return False
            await bus.sleep(POLL_INTERVAL)
        return True

    def __repr__(self) -> str:
        state = "armed" if self.armed else "off"
        unverified = "" if self.verified else ", its parameters unverified"
        failed = f", failed last with: {self.error}" if self.error else ""
        what = f"{self.action} after {self.timeout:g} s"
        return f"<Watchdog of unit {self._drive.unit}: {what}, {state}{unverified}{failed}>"


class Watchdog(Settings):
    """The drive's own time-out, set and kept from running out until `close`.

    `Drive.watchdog` makes one. Its parameters are in force when it has been made. Attributes as in `Settings`.
    """

    def __init__(self, drive: Motion, timeout: float, action: str) -> None:
        super().__init__(drive, timeout, action)
        at_once(self.set())
        self._closed = False
        self._over = threading.Event()
        self._thread = threading.Thread(
            target=self._keep_busy, name=f"drivebus watchdog of unit {drive.unit}", daemon=True
        )
        self._thread.start()
        atexit.register(self._rest)

    def close(self) -> None:
        """Ends it. A motor that slows down is waited for; then the drive gets back the settings that it had.

        Where the motor goes on turning, or cannot be asked, the settings stay: the line falls silent, and the drive
        acts by itself (`armed`). Nothing is raised for that; `error` has the reason. Closing again does nothing.
        """
        if self._closed:
            return
        self._closed = True
        try:
            at_once(self.give_back())
        finally:
            self._rest()
            atexit.unregister(self._rest)

    def __enter__(self) -> Watchdog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _keep_busy(self) -> None:
        while not self._over.wait(self.interval):
            if not at_once(self.ask()):
                return

    def _rest(self) -> None:
        """Lets the line fall silent. Also at the end of the program, where no thread may be left inside the core."""
        self._over.set()
        self._thread.join()
