"""Commands that move a motor, and the proof that they did.

Three rules hold for every command. What can be checked is checked before anything is sent. The command is sent once and
never repeated. Success is what the drive's own state says afterwards; if that cannot be learnt, the caller is told so.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import NamedTuple

from drivebus import checks
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, PortError, Refused, Unconfirmed
from drivebus.registers import Registers
from drivebus.values import ControlSource, Fault, State, Value

__all__ = ["POLL_INTERVAL", "Motion", "Seen"]

POLL_INTERVAL = 0.02
"""Seconds of the line's clock between two looks at the state."""

_LINE_ERRORS = (NoAnswer, BadAnswer, PortError)

_FAILURES_ALLOWED = 1
"""Of the last ten exchanges with a unit. One answer in ten may be lost on a line that works, to a burst of noise. Where
two are, the next may be the one that stops the motor."""

_LOOKS_TO_PROVE = 10
"""Looks at the state that prove a link in doubt: as many as `Link` counts, so that the old ones count no more."""

_MAY = {
    "run_forward": "the motor may turn",
    "run_reverse": "the motor may turn",
    "jog_forward": "the motor may turn",
    "jog_reverse": "the motor may turn",
    "stop": "the motor may still turn",
    "coast": "the motor may still be fed",
    "jog_stop": "the motor may still turn",
    "reset_fault": "the fault may be reset, and a drive that is still told to run may start",
}
"""What may have happened when a command was sent and nothing is known of it."""

_HALTS = ("stop", "coast", "jog_stop")
"""Commands that go out at once, even to a drive that seems deaf: it may hear although nothing is heard of it."""


class Seen(NamedTuple):
    """The status words of one read, decoded."""

    state: State
    fields: Mapping[str, str]
    fault: Fault | None
    time: float

    @property
    def source(self) -> ControlSource | None:
        """Where the drive takes its commands from, if its words tell."""
        channel = self.fields.get("control_channel")
        return next((source for source in ControlSource if source.value == channel), None)

    def __str__(self) -> str:
        return f"{self.state}, {self.fault}" if self.fault else str(self.state)


class Motion(Registers):
    """Starts, stops and resets one drive. Times are seconds of the line's clock, real or simulated."""

    async def run(
        self, hz: float | None = None, reverse: bool = False, *, confirm: float = 1.0, force: bool = False
    ) -> None:
        """Starts the motor; with *hz*, the setpoint travels in the same frame where the drive takes it.

        Returns when the state word shows it running, not when it has reached its speed: see `wait_for_speed`.

        Args:
            hz: Setpoint in Hz, 0 to the drive's own maximum; None keeps the one it has.
            reverse: Turn the other way.
            confirm: Seconds until the state word must show it; 0 does not look.
            force: Start although the link is bad. Then it may be impossible to stop the motor over the bus.

        Where two or more of the last ten exchanges failed, the link is proved first, by ten looks at the state.

        Raises:
            NotAllowed: The drive is in fault, not under bus control, or *hz* is above its maximum; the link is bad; or
                another drive answers at this address since the port was opened again. Nothing was sent that moves it.
            Refused: The drive did not start.
            NoAnswer, BadAnswer, PortError: The line failed before the command was sent.
            Unconfirmed: The command was sent; the message names the state seen last. It is not repeated.
        """
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        await self._prove_link(force)
        raw = None if hz is None else await self._setpoint_word(hz)
        before = await self._ready_to_start()
        await self._start("run_reverse" if reverse else "run_forward", raw, reverse, before, confirm)

    async def jog(self, reverse: bool = False, *, confirm: float = 1.0, force: bool = False) -> None:
        """Jogs the motor at the drive's jog frequency, until `jog_stop`. Checks and errors are those of `run`.

        A motor that turns already is not jogged (`NotAllowed`): its state would look like a jog, and `jog_stop` would
        not end it.
        """
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        await self._prove_link(force)
        before = await self._ready_to_start()
        if before.state.running:
            raise NotAllowed(
                f"unit {self.unit} turns already ({before.state}); nothing that moves it was sent. stop() it, and "
                "wait_until_stopped(), before a jog",
                unit=self.unit,
            )
        await self._start("jog_reverse" if reverse else "jog_forward", None, reverse, before, confirm)

    async def stop(self, *, confirm: float = 1.0) -> None:
        """Stops the motor as the drive is set to: by a ramp, usually. Sent at once, whatever the state is.

        Returns when the drive is stopped or its frequency falls; `wait_until_stopped` waits for the end.

        It overtakes whatever else waits for the line, as do the reads that confirm it, and goes out to a drive that
        seems deaf too. Sent once.

        Raises:
            Refused: The drive did not take it; it still runs if it ran.
            PortError: It could not be sent; the drive goes on as it was.
            Unconfirmed: It was sent, and the drive does not show it: the motor may still turn.
        """
        await self._halt("stop", confirm)

    async def coast(self, *, confirm: float = 1.0) -> None:
        """Takes the voltage off the motor, which turns on until friction ends it. Errors as for `stop`."""
        await self._halt("coast", confirm)

    async def jog_stop(self, *, confirm: float = 1.0) -> None:
        """Ends a jog by the jog's own ramp. Errors as for `stop`."""
        await self._halt("jog_stop", confirm)

    async def reset_fault(self, *, confirm: float = 1.0) -> None:
        """Resets a fault whose cause is gone. Sends nothing where there is none.

        Raises:
            NotAllowed: Another drive answers at this address since the port was opened again. Nothing was sent.
            Refused: The drive did not take it.
            NoAnswer, BadAnswer, PortError: The line failed before the command was sent.
            Unconfirmed: It was sent, once, and the fault is still there: its cause is, most likely. Or nothing is
                known of it.
        """
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        if (await self.look()).state is not State.FAULT:
            return

        async def shows(seen: Seen) -> bool:
            return seen.state not in (State.FAULT, State.UNKNOWN)

        await self._command("reset_fault")
        await self._confirm("reset_fault", shows, confirm)

    async def ask_setpoint(self) -> float:
        """The setpoint last given over the bus, in Hz."""
        return float(await self.read("set_frequency"))

    async def set_setpoint(self, hz: float) -> None:
        """Gives a setpoint in Hz: changes the speed of a motor that runs.

        Raises:
            NotAllowed: Above the drive's own maximum or out of range, or another drive answers at this address since
                the port was opened again; nothing was sent.
            NoAnswer, BadAnswer, PortError: The drive may have taken it all the same, unless the error's `started` is
                None. A confirmation that was lost was cleared up by reading, as `write` does, and that failed too.
            Unconfirmed: The drive shows another setpoint, however often it was written.
            Refused: The drive kept the old one.
        """
        await self._write_setpoint(await self._setpoint_word(hz))

    async def _write_setpoint(self, word: int) -> None:
        await self._write(
            self.profile.address("set_frequency"), word, read_back=self.profile.read_back("set_frequency")
        )

    async def look(self, *, urgent: bool = False) -> Seen:
        """The status words, in one read."""
        names = ("status_word_1", "status_word_2", "fault_code")
        first, *_ = places = [self.profile.address(name) for name in names]
        with self._explained():
            words, time, _ = await self.bus.read_stamped(self.unit, first, max(places) - first + 1, urgent=urgent)
        state, fields, fault = (words[place - first] for place in places)
        seen = Seen(
            self._state_of(state),
            self.profile.fields("status_word_2", fields),
            self.profile.fault(fault) if fault else None,
            time,
        )
        self._remember(str(seen))
        return seen

    async def _prove_link(self, force: bool) -> None:
        """No motor starts on a link that may not carry its stop. Sends nothing where the last exchanges went well."""
        link = await self.bus.link(self.unit)
        if force or link.failed <= _FAILURES_ALLOWED:
            return
        lost = looks = 0
        while looks < _LOOKS_TO_PROVE and lost <= _FAILURES_ALLOWED:
            looks += 1
            try:
                await self.state()
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

    async def _setpoint_word(self, hz: float) -> int:
        hz = checks.number("setpoint", hz, 0.0)
        raw = self.profile.encode("set_frequency", hz)
        limit = self.profile.maximum_frequency
        if limit is not None:
            highest: Value = await self.read(limit)
            if hz > highest:
                raise NotAllowed(
                    f"setpoint {hz:g} Hz is above the drive's own maximum, {limit} = {highest:g} Hz; "
                    f"allowed is 0..{highest:g} Hz. No setpoint was sent to unit {self.unit}",
                    unit=self.unit,
                )
        return raw

    async def _ready_to_start(self) -> Seen:
        seen = await self.look()
        if seen.state is State.FAULT:
            raise NotAllowed(
                f"unit {self.unit} is in fault {seen.fault or '(not named)'}; nothing that moves it was sent. "
                "Remove the cause, then reset_fault()",
                unit=self.unit,
            )
        if seen.state is State.POWER_OFF:
            raise NotAllowed(
                f"unit {self.unit} has no voltage on its DC bus; nothing that moves it was sent", unit=self.unit
            )
        if seen.source not in (ControlSource.COMMUNICATION, None):
            raise NotAllowed(
                f"unit {self.unit} takes its commands from the {seen.source}, not from the bus; nothing that moves it "
                "was sent. prepare_control() (`drivebus prepare`) sets it to obey the bus",
                unit=self.unit,
            )
        return seen

    async def _start(self, command: str, setpoint: int | None, reverse: bool, before: Seen, confirm: float) -> None:
        wanted = State.REVERSE if reverse else State.FORWARD
        turning_round = before.state.running and before.state is not wanted
        frequency = await self._running_frequency() if turning_round else 0.0
        await self._command(command, setpoint)

        async def shows(seen: Seen) -> bool:
            # A motor that turns the other way must slow down first; its state word follows at zero.
            return seen.state is wanted or (turning_round and await self._running_frequency() < frequency)

        await self._confirm(command, shows, confirm)

    async def _halt(self, command: str, confirm: float) -> None:
        confirm = checks.number("confirm", confirm, 0.0, 3600.0)
        await self._command(command)
        first: list[float] = []

        async def shows(seen: Seen) -> bool:
            if seen.state is State.UNKNOWN:
                return False
            if not seen.state.running:
                return True
            first.append(await self._running_frequency(urgent=True))
            return first[-1] < first[0]

        await self._confirm(command, shows, confirm)

    async def _running_frequency(self, *, urgent: bool = False) -> float:
        [word] = await self.read_words(self.profile.address("running_frequency"), urgent=urgent)
        return float(self.value("running_frequency", word))

    async def _command(self, name: str, setpoint: int | None = None) -> None:
        """Sends the command word once, with the setpoint behind it where the drive has both side by side."""
        urgent = name in _HALTS
        address, code = self.profile.command(name)
        words: int | list[int] = code
        if setpoint is not None:
            place = self.profile.address("set_frequency")
            if place == address + 1:
                words = [code, setpoint]
            else:
                await self._write_setpoint(setpoint)
        try:
            if urgent:
                await self._send(address, words, urgent=True)
            else:
                await self._write(address, words)
        except _LINE_ERRORS as error:
            if error.started is None:
                if not urgent:
                    raise
                raise type(error)(
                    f"{name} could not be sent to unit {self.unit} ({error}); {_MAY[name]}",
                    unit=self.unit,
                    request=error.request,
                    ended=error.ended,
                ) from error
            raise Unconfirmed(
                f"{name} was sent to unit {self.unit} and not confirmed ({error}); {_MAY[name]}. "
                f"{await self._state_afterwards(urgent)}. It was not repeated",
                unit=self.unit,
                request=error.request,
                raw=error.raw,
                started=error.started,
                ended=error.ended,
            ) from error

    async def _state_afterwards(self, urgent: bool) -> str:
        try:
            return f"State seen afterwards: {await self.look(urgent=urgent)}"
        except (*_LINE_ERRORS, Refused) as error:
            return f"Its state could not be read afterwards either ({type(error).__name__}); {self._seen_last()}"

    async def _confirm(self, command: str, shows: Callable[[Seen], Awaitable[bool]], within: float) -> None:
        if within == 0:
            return
        deadline = self.bus.now() + within
        while True:
            try:
                seen = await self.look(urgent=command in _HALTS)
                if await shows(seen):
                    return
                last = f"state seen last: {seen}"
                source = seen.source
                if source not in (ControlSource.COMMUNICATION, None):
                    last += f", with commands from the {source}"
                if seen.fault is not None and command != "reset_fault":
                    break
            except (NoAnswer, BadAnswer, Refused) as error:
                # A refusal here is one of a read: it says nothing about the command.
                last = f"its last answer: {error}; {self._seen_last()}"
            except PortError as error:
                raise Unconfirmed(
                    f"{command} was sent to unit {self.unit}; the port was lost before its state showed it ({error}): "
                    f"{_MAY[command]}; {self._seen_last()}. It was not repeated",
                    unit=self.unit,
                ) from error
            if self.bus.now() >= deadline:
                break
            await self.bus.sleep(POLL_INTERVAL)
        raise Unconfirmed(
            f"{command} was sent to unit {self.unit}, and its state does not show it: {_MAY[command]}; {last}. "
            "It was not repeated",
            unit=self.unit,
        )
