"""Commands that move a motor, and the proof that they did.

Three rules hold for every command. What can be checked is checked before anything is sent. The command is sent once and
never repeated. Success is what the drive's own state says afterwards; if that cannot be learnt, the caller is told so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

from drivebus import checks
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, Refused
from drivebus.operations.commands import Commanding
from drivebus.operations.program_end import before_start
from drivebus.operations.ramp import Fall
from drivebus.operations.state import Seen
from drivebus.values import ControlSource, State, Value

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Motion"]

_FAILURES_ALLOWED = 1
"""Of the last ten exchanges with a unit. One answer in ten may be lost on a line that works, to a burst of noise. Where
two are, the next may be the one that stops the motor."""

_LOOKS_TO_PROVE = 10
"""Looks at the state that prove a link in doubt: as many as `Link` counts, so that the old ones count no more."""


class _Ramp(NamedTuple):
    """How a drive is set to slow down: in Hz/s, None where that is not known; and whether only the bus tells it to."""

    slope: float | None
    only_by_bus: bool


class Motion(Commanding):
    """Starts, stops and resets one drive. Times are seconds of the line's clock, real or simulated."""

    async def run(
        self,
        hz: float | None = None,
        reverse: bool = False,
        *,
        confirm: float = 1.0,
        force: bool = False,
        unverified: bool = False,
    ) -> None:
        """Starts the motor; with *hz*, the setpoint travels in the same frame where the drive takes it.

        Returns when the state word shows it running, not when it has reached its speed: see `wait_for_speed`. Where the
        family has no state that may be used, when the drive has confirmed the command and shows no fault.

        Args:
            hz: Setpoint in Hz, 0 to the drive's own maximum; None keeps the one it has.
            reverse: Turn the other way.
            confirm: Seconds until the state word must show it; 0 does not look.
            force: Start although the link is bad. Then it may be impossible to stop the motor over the bus.
            unverified: Also where command, states or setpoint are not verified for the family. What ends it then needs
                no such word.

        Where two or more of the last ten exchanges failed, the link is proved first, by ten looks at the state.

        Raises:
            NotAllowed: The drive is in fault, not under bus control, or takes its speed from elsewhere; *hz* is above
                its maximum; the link is bad; another drive answers at this address since the port was opened again; or
                something is not verified for the family: the command, or both ways to stop what it starts. Nothing was
                sent that moves it.
            Refused: The drive did not start.
            NoAnswer, BadAnswer, PortError: The line failed before the command was sent.
            Unconfirmed: The command was sent; the message names the state seen last. It is not repeated.
        """
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        command = "run_reverse" if reverse else "run_forward"
        drive = self.trusting(unverified)
        drive._check_start(command)
        await drive._prove_link(force)
        if hz is not None:
            drive = await drive._with_setpoint("frequency")
        raw = None if hz is None else await drive._setpoint_word(hz)
        before = await drive._ready_to_start()
        if hz is not None:
            await drive._check_set(drive.profile.needs("frequency"), "would not take its speed from the bus")
        await drive._start(command, raw, reverse, before, confirm)

    async def jog(
        self, reverse: bool = False, *, confirm: float = 1.0, force: bool = False, unverified: bool = False
    ) -> None:
        """Jogs the motor at the drive's jog frequency, until `jog_stop`. Checks and errors are those of `run`.

        A motor that turns already is not jogged (`NotAllowed`): its state would look like a jog, and `jog_stop` would
        not end it.
        """
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        command = "jog_reverse" if reverse else "jog_forward"
        drive = self.trusting(unverified)
        drive._check_start(command)
        await drive._prove_link(force)
        before = await drive._ready_to_start()
        if before.state.running:
            raise NotAllowed(
                f"unit {self.unit} turns already ({before.state}); nothing that moves it was sent. stop() it, and "
                "wait_until_stopped(), before a jog",
                unit=self.unit,
            )
        await drive._start(command, None, reverse, before, confirm)

    async def stop(self, *, confirm: float = 1.0, unverified: bool = False) -> None:
        """Stops the motor as the drive is set to: by a ramp, usually. Sent at once, whatever the state is.

        Returns after half a second and a hertz of the drive's own ramp, where the motor ran at its setpoint and only
        the bus tells it what to do (docs/safety.md has the rule); else when the drive is stopped. `wait_until_stopped`
        waits for that in any case. Where the family has no state that may be used, returns when the drive has confirmed
        the command.

        A frequency that falls is looked at beyond *confirm*: for as long as it falls, and a minute at most, or where
        the drive's ramp is known half as long again as that takes. A drive that tells none is looked at for *confirm*.

        It overtakes whatever else waits for the line, as do the reads that confirm it, and goes out to a drive that
        seems deaf too. Sent once.

        Raises:
            NotAllowed: The command is not verified for the family, and nothing was started as *unverified* either. It
                was not sent.
            Refused: The drive did not take it; it still runs if it ran.
            PortError: It could not be sent; the drive goes on as it was.
            Unconfirmed: It was sent, and the drive does not show it: the motor may still turn.
        """
        await self.trusting(unverified)._halt("stop", confirm)

    async def coast(self, *, confirm: float = 1.0, unverified: bool = False) -> None:
        """Takes the voltage off the motor, which turns on until friction ends it. Errors as for `stop`.

        Returns when the drive is stopped: what coasts has no ramp.
        """
        await self.trusting(unverified)._halt("coast", confirm)

    async def jog_stop(self, *, confirm: float = 1.0, unverified: bool = False) -> None:
        """Ends a jog by the jog's own ramp. Errors as for `stop`; without such a command they say what does."""
        drive = self.trusting(unverified)
        if "jog_stop" not in self.profile.commands():
            jogs = "jog_forward" in self.profile.commands()
            ends = ": stop() ends it along the ramp, coast() takes the voltage off" if jogs else ", nor one to jog"
            raise NotAllowed(
                f"{self.profile.title} has no command that ends a jog alone{ends}; "
                f"nothing was sent to unit {self.unit}",
                unit=self.unit,
            )
        await drive._halt("jog_stop", confirm)

    async def end_jog(self, *, unverified: bool = False) -> None:
        """Ends a jog as the family does: by its jog stop, or else by a stop. Errors as for `stop`."""
        drive = self.trusting(unverified)
        await (drive.jog_stop() if drive.has_jog_stop() else drive.stop())

    def has_jog_stop(self) -> bool:
        """Whether the family has a command that ends a jog alone, and it may be given."""
        return self._halting("jog_stop")._evidence.unusable("jog_stop") is None

    async def reset_fault(self, *, confirm: float = 1.0, unverified: bool = False) -> None:
        """Resets a fault whose cause is gone. Sends nothing where there is none.

        Raises:
            NotAllowed: The command is not verified for the family, or another drive answers at this address since the
                port was opened again. Nothing was sent.
            Refused: The drive did not take it.
            NoAnswer, BadAnswer, PortError: The line failed before the command was sent.
            Unconfirmed: It was sent, once, and the fault is still there: its cause is, most likely. Or nothing is
                known of it.
        """
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        drive = self.trusting(unverified)
        drive._evidence.commands("reset_fault")
        before = await drive._glance()
        untold = "state" in before.missing and "fault" in before.missing
        if not (before.tripped or untold):
            return

        async def shows(seen: Seen) -> bool:
            return not seen.tripped and ("state" in seen.missing or seen.state is not State.UNKNOWN)

        await drive._command("reset_fault")
        await drive._confirm("reset_fault", shows, confirm)

    async def _prove_link(self, force: bool) -> None:
        """No motor starts on a link that may not carry its stop. Sends nothing where the last exchanges went well."""
        link = await self.bus.link(self.unit)
        if force or link.failed <= _FAILURES_ALLOWED:
            return
        lost = looks = 0
        while looks < _LOOKS_TO_PROVE and lost <= _FAILURES_ALLOWED:
            looks += 1
            try:
                await self.ping()
            except Refused:
                pass
            except (NoAnswer, BadAnswer):
                lost += 1
        link = await self.bus.link(self.unit)
        if lost > _FAILURES_ALLOWED or link.failed > _FAILURES_ALLOWED:
            raise NotAllowed(
                f"the link to unit {self.unit} is bad: {link}, and {lost} of {looks} looks at its state failed; "
                "nothing that moves it was sent, for its stop might be lost as well. Mend the line (bus.stats() may "
                "say how), or start all the same with force=True (`--force`)",
                unit=self.unit,
            )

    async def _ready_to_start(self, *, by_bus: bool = True) -> Seen:
        seen = await self._glance()
        if seen.tripped:
            raise NotAllowed(
                f"unit {self.unit} is in fault {seen.fault or '(not named)'}; nothing that moves it was sent. "
                "Remove the cause, then reset_fault()",
                unit=self.unit,
            )
        if seen.state is State.POWER_OFF:
            raise NotAllowed(
                f"unit {self.unit} has no voltage on its DC bus; nothing that moves it was sent", unit=self.unit
            )
        if by_bus and seen.source not in (ControlSource.COMMUNICATION, None):
            raise NotAllowed(
                f"unit {self.unit} takes its commands from the {seen.source}, not from the bus; nothing that moves it "
                "was sent. prepare_control() (`drivebus prepare`) sets it to obey the bus",
                unit=self.unit,
            )
        if by_bus and seen.source is None:
            await self._check_set(self._wanted_of_commands(), "does not take its commands from the bus")
        return seen

    async def _start(self, command: str, setpoint: int | None, reverse: bool, before: Seen, confirm: float) -> None:
        wanted = State.REVERSE if reverse else State.FORWARD
        turning_round = before.state.running and before.state is not wanted
        frequency = await self.output_frequency() if turning_round else None
        # Who started it so must not be kept from stopping it.
        self._ventured.update([command] if self.unverified else [])
        before_start()
        # Before it is sent: whoever is interrupted from here on has to end it.
        self._starts[0] += 1
        self._started_as[:] = [State.UNKNOWN if command.startswith("jog") else wanted]
        await self._command(command, setpoint)

        async def shows(seen: Seen) -> bool:
            if "state" in seen.missing:
                return seen.fault is None
            if seen.state is wanted:
                return True
            # A motor that turns the other way must slow down first; its state word follows at zero.
            now = await self.output_frequency() if turning_round else None
            return now is not None and frequency is not None and now < frequency

        await self._confirm(command, shows, confirm)

    async def _halt(self, command: str, confirm: float) -> None:
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        drive = self._halting(command)
        drive._evidence.commands(command)
        sent = drive.bus.now()
        await drive._command(command)
        if drive._evidence.without_state() is not None:
            return  # its confirmation is all there is
        fall = Fall(sent, drive.bus.now(), confirm)
        # What coasts has no ramp, and what jogs is not at its setpoint.
        by_ramp = command == "stop"
        ramp: _Ramp | None = None

        async def shows(seen: Seen) -> bool:
            nonlocal by_ramp, ramp
            asked = drive.bus.now()
            if seen.state.at_rest:
                return fall.rests(asked)
            fall.goes_on()
            if not seen.state.running:
                return False
            urgent = not fall.is_overdue(asked)
            frequency, setpoint = await drive._frequencies(urgent=urgent)
            if frequency is None:
                return False
            fall.see(frequency, setpoint, asked, drive.bus.now())
            by_ramp &= seen.source in (ControlSource.COMMUNICATION, None) and drive._turns_as_started(seen.state)
            if ramp is None and fall.is_worth_asking():
                ramp = await drive._ramp(urgent=urgent)
                # One that is slow to say nothing of it has still been falling meanwhile.
                fall.until += drive.bus.now() - fall.seen_at
            if ramp is None or ramp.slope is None:
                return False
            return fall.goes_along(ramp.slope) and ramp.only_by_bus and by_ramp

        await drive._confirm(command, shows, confirm, fall)

    def _turns_as_started(self, state: State) -> bool:
        """Whether it turns as it was started here last, if it was: not the other way still, nor maybe in a jog."""
        return self._started_as in ([], [state])

    def _halting(self, command: str) -> Self:
        """Itself; where a start was forced on what is not verified, as *command* is, with the same trust."""
        return self.trusting(bool(self._ventured) and self._evidence.unusable(command) is not None)

    async def _frequencies(self, *, urgent: bool) -> tuple[float | None, float]:
        """Output frequency and setpoint in force, in Hz, in one read; what the family does not tell is None, or inf."""
        names = {role: self.profile.role(role) for role in ("frequency", "setpoint")}
        known = {role: name for role, name in names.items() if name and self._evidence.unreadable(name) is None}
        if "frequency" not in known:
            return None, math.inf
        if len({self.profile.describe(name).unit for name in known.values()}) > 1:
            del known["setpoint"]  # in percent, or rpm
        values = await self._told(list(known.values()), urgent=urgent)
        told = {role: abs(float(values[name])) for role, name in known.items()}
        return told["frequency"], told.get("setpoint", math.inf)

    async def _ramp(self, *, urgent: bool) -> _Ramp:
        """How a stop slows the motor down, and who else may, as the drive's parameters say it."""
        time, start = self.profile.role("deceleration"), self.profile.role("ramp_start")
        wanted = self._wanted(None)
        codes = [row["code"] for row in wanted]
        readable = self._evidence.readable([*codes, *(name for name in (time, start) if name)])
        try:
            told = await self._told(readable, urgent=urgent)
        except (NoAnswer, BadAnswer, Refused):
            told = {}  # then its standstill has to prove it
        seconds, hz = float(told.get(time or "", 0.0)), float(told.get(start or "", 0.0))
        only_by_bus = bool(wanted) and all(told.get(row["code"]) == row["value"] for row in wanted)
        return _Ramp(hz / seconds if hz > 0 and seconds > 0 else None, only_by_bus)

    async def _told(self, names: Sequence[str], *, urgent: bool) -> dict[str, Value]:
        """What the drive says of *names*, in the fewest requests."""
        if not names:
            return {}
        plan = self.profile.compile(names)
        words = [await self.read_words(address, count, urgent=urgent) for address, count in plan.reads]
        return dict(zip(plan.names, plan.values(words), strict=True))

    async def output_frequency(self, *, urgent: bool = False) -> float | None:
        """In Hz; None where the family does not tell."""
        register = self.profile.role("frequency")
        if register is None or self._evidence.unreadable(register) is not None:
            return None
        [word] = await self.read_words(self.profile.address(register), urgent=urgent)
        return float(self.value(register, word))
