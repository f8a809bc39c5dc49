"""All that can be asked of one drive, in the words of its family, written once for whoever waits and however.

`drivebus.aio.Drive` is awaited, `drivebus.Drive` carries the same out at once.
"""

from __future__ import annotations

from collections.abc import Callable

from drivebus import checks
from drivebus.backup import Keeping
from drivebus.errors import Unconfirmed
from drivebus.motion import POLL_INTERVAL, Motion, Seen
from drivebus.values import Control, ControlItem, Fault, Snapshot, State, Status

__all__ = ["Operations"]

_STANDSTILL = 0.05
"""Output frequency in Hz below which a drive that has stopped counts as stopped."""


class Operations(Keeping, Motion):
    """All that can be asked of a drive.

    Nothing is kept between calls but what was written to RAM, how often EEPROM was written, what the drive said it is,
    and, for errors, its last state. Safe from any thread; a command and its confirmation are several requests, between
    which others may come.
    """

    async def status(self) -> Status:
        """State, readiness, control source, frequency and fault, in two reads.

        Raises:
            NoAnswer, BadAnswer, Refused: See each.
        """
        return await self._status(await self.look())

    async def _status(self, seen: Seen) -> Status:
        frequencies = await self.snapshot("running_frequency", "set_frequency_actual")
        motor = seen.fields.get("motor", "")
        ready = seen.fields.get("ready")
        alarm = seen.fields.get("overload_alarm")
        return Status(
            state=seen.state,
            ready=None if ready is None else ready == "ready",
            source=seen.source,
            motor=int(motor.removeprefix("motor ")) if motor.startswith("motor ") else None,
            overload_alarm=None if alarm is None else alarm != "none",
            frequency=float(frequencies["running_frequency"]),
            setpoint=float(frequencies["set_frequency_actual"]),
            fault=seen.fault,
            fields=seen.fields,
            time=seen.time,
        )

    async def fault(self) -> Fault | None:
        """The present fault, or None."""
        return (await self.look()).fault

    async def fault_history(self) -> list[Fault]:
        """The last faults, the latest first; as many as the drive keeps."""
        names = self.profile.fault_history
        if not names:
            return []
        return [self.profile.fault(int(code)) for code in (await self.snapshot(*names)).values() if code]

    async def monitor(self, *names: str) -> Snapshot:
        """Reads *names*, or all monitor registers of the family, in the fewest requests, under one time stamp.

        The result is a mapping whose names are attributes too: `drive.monitor().output_current`; its `units` say in
        what each is.

        Raises:
            NotAllowed: An unknown name; nothing was sent.
            NoAnswer, BadAnswer, Refused: See each.
        """
        return await self.snapshot(*(names or self.profile.monitor_names()))

    async def wait_for_speed(self, hz: float | None = None, tolerance: float = 0.1, timeout: float = 60.0) -> Status:
        """Waits until the output frequency is *hz*, or the setpoint in force if None.

        Args:
            hz: Wanted output frequency in Hz, whichever way the motor turns.
            tolerance: How far off it may be, in Hz.
            timeout: Seconds of the line's clock.

        Raises:
            Unconfirmed: The drive tripped meanwhile, or the time was up; the message says where it stands. The drive
                keeps running if it ran.
            NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
        """
        wanted = None if hz is None else checks.number("frequency", hz, 0.0)
        tolerance = checks.number("tolerance", tolerance, 0.0)
        goal = "its setpoint" if wanted is None else f"{wanted:g} Hz"

        def reached(status: Status) -> bool:
            target = status.setpoint if wanted is None else wanted
            # Hundredths are what drives count in; binary floats must not turn 0.1 into a miss.
            return status.state.running and abs(status.frequency - target) <= tolerance + 1e-9

        return await self._wait(reached, f"{goal} was not reached", timeout)

    async def wait_until_stopped(self, timeout: float = 60.0) -> Status:
        """Waits until the drive is stopped and its output frequency is zero.

        A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.

        Raises:
            Unconfirmed: The drive tripped meanwhile, or the time was up.
            NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
        """

        def stopped(status: Status) -> bool:
            known = status.state is not State.UNKNOWN
            return known and not status.state.running and status.frequency <= _STANDSTILL

        return await self._wait(stopped, "it did not stop", timeout)

    async def check_control(self) -> Control:
        """Whether the drive is set to obey the bus: a list that is true when every item is as it must be."""
        wanted = self.profile.control()
        actual = await self.snapshot(*(item["code"] for item in wanted))
        return Control(
            ControlItem(
                code=item["code"],
                wanted=self.value(item["code"], item["value"]),
                actual=actual[item["code"]],
                ok=actual[item["code"]] == item["value"],
                verified=item["verified"],
                label=item["label"],
                note=item["note"] or "",
            )
            for item in wanted
        )

    async def prepare_control(self, store: bool = False) -> Control:
        """Sets the drive to obey the bus, writing only what differs, and returns what `check_control` then says.

        To RAM: the drive forgets it when it is switched off, unless *store*, which keeps what this object set in RAM
        before as well.

        Raises:
            Refused: The drive kept what it had; parameters are locked while it runs, or by a password.
            Unconfirmed: It took the values, and shows others.
        """
        needed = {
            item.code: item.wanted
            for item in await self.check_control()
            if not item.ok or (store and item.code in self._in_ram)
        }
        if needed:
            await self.write(needed, store=store)
        control = await self.check_control()
        if not control:
            raise Unconfirmed(
                f"unit {self.unit} took the settings and shows others:\n{control}",
                unit=self.unit,
            )
        return control

    async def _wait(self, reached: Callable[[Status], bool], otherwise: str, timeout: float) -> Status:
        timeout = checks.number("timeout", timeout, 0.0)
        deadline = self.bus.now() + timeout
        while True:
            status = await self.status()
            if status.state is State.FAULT or status.fault is not None:
                raise Unconfirmed(
                    f"unit {self.unit} tripped while waiting: {status.fault or 'fault not named'}", unit=self.unit
                )
            if reached(status):
                return status
            if self.bus.now() >= deadline:
                raise Unconfirmed(
                    f"unit {self.unit}: {otherwise} within {timeout:g} s; it is {status}",
                    unit=self.unit,
                )
            await self.bus.sleep(POLL_INTERVAL)
