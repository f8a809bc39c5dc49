"""All that can be asked of one drive, in the words of its family, written once for whoever waits and however.

`drivebus.aio.Drive` is awaited, `drivebus.Drive` carries the same out at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from drivebus import checks
from drivebus.backup import Keeping
from drivebus.errors import NotAllowed, Unconfirmed
from drivebus.operations.bits import Terminals
from drivebus.operations.commands import POLL_INTERVAL
from drivebus.operations.state import Seen
from drivebus.profile import Profile
from drivebus.profile.evidence import Evidence
from drivebus.values import Fault, Snapshot, State, Status

__all__ = ["Operations"]

_STANDSTILL = 0.05
"""Output frequency in Hz below which a drive that has stopped counts as stopped."""


class Operations(Keeping, Terminals):
    """All that can be asked of a drive.

    Nothing is kept between calls but what was written to RAM, how often EEPROM was written, what the drive said it is,
    and, for errors, its last state. Safe from any thread; a command and its confirmation are several requests, between
    which others may come.
    """

    def _know(self, profile: Profile, unverified: bool) -> None:
        super()._know(profile, unverified)
        self._monitored: list[str] | None = None

    async def status(self, *, unverified: bool = False) -> Status:
        """State, readiness, control source, frequency and fault, in two reads where the family has them together.

        What the family does not tell, or what is not verified, is None (the state: `State.UNKNOWN`), and `missing` has
        the reason.

        Raises:
            NoAnswer, BadAnswer, Refused: See each.
        """
        drive = self.trusting(unverified)
        return await drive._status(await drive._glance())

    async def _status(self, seen: Seen) -> Status:
        missing = dict(seen.missing)
        names = {}
        for role in ("frequency", "setpoint"):
            name = self.profile.role(role)
            reason = f"no such register of {self.profile.title} is known"
            if name is not None:
                reason = self._evidence.unreadable(name) or ""
            if name is None or reason:
                missing[role] = reason
            else:
                names[role] = name
        frequencies = await self.snapshot(*names.values()) if names else {}
        told = {role: float(frequencies[name]) for role, name in names.items()}
        motor = seen.fields.get("motor", "")
        ready = seen.fields.get("ready")
        alarm = seen.fields.get("overload_alarm")
        for what, field in (
            ("ready", ready),
            ("source", seen.source),
            ("motor", motor or None),
            ("overload_alarm", alarm),
        ):
            if field is None:
                missing[what] = f"no status word of {self.profile.title} that may be read tells it"
        return Status(
            state=seen.state,
            ready=None if ready is None else ready == "ready",
            source=seen.source,
            motor=int(motor.removeprefix("motor ")) if motor.startswith("motor ") else None,
            overload_alarm=None if alarm is None else alarm != "none",
            frequency=told.get("frequency"),
            setpoint=told.get("setpoint"),
            fault=seen.fault,
            fields=seen.fields,
            time=seen.time or getattr(frequencies, "time", 0.0),
            missing=missing,
        )

    async def fault(self, *, unverified: bool = False) -> Fault | None:
        """The present fault, or None.

        Raises:
            NotAllowed: The family has no fault register that is known, or verified. Nothing was sent.
        """
        drive = self.trusting(unverified)
        reason = drive._evidence.without_fault()
        if reason is not None:
            raise drive._evidence.missing("the present fault may not be read", reason, Evidence.without_fault)
        return (await drive._glance()).fault

    async def fault_history(self, *, unverified: bool = False) -> list[Fault]:
        """The last faults, the latest first; as many as the drive keeps.

        The latest has its `values`: what the drive saw when it tripped, where it keeps that.
        """
        drive = self.trusting(unverified)
        names = drive._evidence.readable(drive.profile.fault_history)
        if not names:
            return []
        codes = (await drive.snapshot(*names)).values()
        faults = [drive.profile.fault(int(code)) for code in codes if code]
        kept = drive._evidence.readable(drive.profile.fault_values)
        if faults and kept:
            faults[0] = replace(faults[0], values=await drive.snapshot(*kept))
        return faults

    async def monitor(self, *names: str, unverified: bool = False) -> Snapshot:
        """Reads *names*, or all monitor registers of the family, in the fewest requests, under one time stamp.

        The result is a mapping whose names are attributes too: `drive.monitor().output_current`; its `units` say in
        what each is. Without names, what is not verified is left out.

        Raises:
            NotAllowed: An unknown name, or one that is not verified; nothing was sent.
            NoAnswer, BadAnswer, Refused: See each.
        """
        drive = self.trusting(unverified)
        return await drive.snapshot(*(names or drive.readable()))

    def readable(self, *names: str) -> list[str]:
        """*names*, or without any the monitor registers of the family that may be read. Nothing is sent.

        Raises:
            NotAllowed: An unknown name, one that is not verified, or one whose meaning a parameter of the drive decides
                (`variants` of `bus.drive` says which).
        """
        if not names:
            # The same each time, and looked up for every sample of a monitor.
            if self._monitored is None:
                known = self._evidence.readable(self.profile.monitor_names())
                self._monitored = [name for name in known if not self._open(name)]
            return list(self._monitored)
        self._evidence.reads(names)
        for name in filter(self._open, names):
            variant = self.profile.describe(name).variant or ""
            rules = self.profile.variants()[variant]
            raise NotAllowed(
                f"what {name} means depends on {rules['parameter']} of unit {self.unit}: give variants=… to "
                f"bus.drive() (`--variant {variant}=…`; {', '.join(map(repr, rules['choices']))})",
                unit=self.unit,
            )
        return list(names)

    def _open(self, name: str) -> bool:
        """Whether a parameter of the drive decides what *name* means, and nobody said how."""
        return self.profile.describe(name).variant in self._open_variants

    async def wait_for_speed(
        self, hz: float | None = None, tolerance: float = 0.1, timeout: float = 60.0, *, unverified: bool = False
    ) -> Status:
        """Waits until the output frequency is *hz*, or the setpoint in force if None.

        Args:
            hz: Wanted output frequency in Hz, whichever way the motor turns.
            tolerance: How far off it may be, in Hz.
            timeout: Seconds of the line's clock.
            unverified: Also by words that are not verified for the family.

        Raises:
            NotAllowed: State or frequency of the family are not known, or not verified. Nothing was sent.
            Unconfirmed: The drive tripped meanwhile, or the time was up; the message says where it stands. The drive
                keeps running if it ran.
            NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
        """
        wanted = None if hz is None else checks.number("frequency", hz, 0.0)
        tolerance = checks.number("tolerance", tolerance, 0.0)
        goal = "its setpoint" if wanted is None else f"{wanted:g} Hz"

        def reached(status: Status) -> bool:
            target = status.setpoint if wanted is None else wanted
            if status.frequency is None or target is None:
                return False
            # Hundredths are what drives count in; binary floats must not turn 0.1 into a miss.
            return status.state.running and abs(status.frequency - target) <= tolerance + 1e-9

        drive = self.trusting(unverified)
        drive._check_told("waiting for the speed", "frequency", *(["setpoint"] if wanted is None else []))
        return await drive._wait(reached, f"{goal} was not reached", timeout)

    def _check_told(self, what: str, *roles: str) -> None:
        """Raises `NotAllowed` if the family does not tell its state, or one of *roles*."""
        self._state_word(what)
        for role in roles:
            name = self.profile.role(role)
            if name is None:
                raise NotAllowed(
                    f"{what} of unit {self.unit} needs its {role}, and {self.profile.title} has no register of it that "
                    "is known",
                    unit=self.unit,
                )
            self._evidence.reads([name])

    async def wait_until_stopped(self, timeout: float = 60.0, *, unverified: bool = False) -> Status:
        """Waits until the drive is stopped and its output frequency is zero.

        A motor that coasts has no output frequency: its shaft may still turn, and the drive does not know.

        Raises:
            NotAllowed: The state of the family is not known, or not verified. Nothing was sent.
            Unconfirmed: The drive tripped meanwhile, or the time was up.
            NoAnswer, BadAnswer, PortError: The line failed; the drive goes on as it was.
        """

        def stopped(status: Status) -> bool:
            turns = status.frequency is not None and status.frequency > _STANDSTILL
            return status.state.at_rest and not turns

        drive = self.trusting(unverified)
        drive._check_told("waiting for the standstill")
        return await drive._wait(stopped, "it did not stop", timeout)

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
