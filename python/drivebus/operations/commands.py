"""One command to one drive: sent once, and proved by what the drive's own state says afterwards.

Where the family has no state that may be used, the drive's confirmation of the command is the proof, and its fault
number is looked at.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence

from drivebus.errors import LINE_ERRORS, BadAnswer, NoAnswer, PortError, Refused, Unconfirmed
from drivebus.operations.ramp import Fall
from drivebus.operations.setpoints import Setpoints
from drivebus.operations.state import Seen
from drivebus.profile.evidence import Evidence
from drivebus.values import ControlSource

__all__ = ["A_WORD", "HALTS", "POLL_INTERVAL", "Commanding"]

POLL_INTERVAL = 0.02
"""Seconds of the line's clock between two looks at the state."""

_WRITE_MANY = 0x10

A_WORD = "a word that can move the motor"

_MAY = {
    A_WORD: "the motor may turn",
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

_WHATEVER_IT_IS = ("reset_fault",)
"""Commands that are given to a unit that contradicts its profile too, as those that halt are: whether a drive gets out
of a fault shall not depend on a name. It has shown that fault in the words of the profile."""

HALTS = ("stop", "coast", "jog_stop")
"""Commands that go out at once, even to a drive that seems deaf: it may hear although nothing is heard of it."""


class Commanding(Setpoints):
    """Sends commands to one drive. Times are seconds of the line's clock, real or simulated."""

    def _check_start(self, command: str) -> None:
        """Raises `NotAllowed` where *command* may not be given, or what it starts could not be stopped again."""
        self._evidence.commands(command)
        self._check_it_can_be_stopped()

    def _check_it_can_be_stopped(self) -> None:
        reasons = {halt: self._evidence.unusable(halt) for halt in ("stop", "coast")}
        if all(reasons.values()):
            told = "; ".join(f"{halt}: {(reason or '').rstrip('.')}" for halt, reason in reasons.items())
            what = f"a motor that unit {self.unit} starts could not be stopped over the bus"
            raise self._evidence.missing(what, told, _both_unusable)

    async def _command(self, name: str, setpoint: int | None = None) -> None:
        """Sends the command word once, with the setpoint behind it where the drive has both side by side."""
        address, code = self.profile.command(name)
        words: int | list[int] = code
        if setpoint is not None:
            together = _WRITE_MANY in self.profile.functions
            if together and self.profile.address(self._setpoint_register("frequency")) == address + 1:
                words = [code, setpoint]
            else:
                await self._write_setpoint(setpoint)
        await self._send_once(name, address, words)

    async def _send_once(self, name: str, address: int, words: int | Sequence[int]) -> None:
        """Sends what may move the motor, once. Where nothing is known of it afterwards, that is said."""
        urgent = name in HALTS
        try:
            if urgent:
                await self._send(address, words, urgent=True)
                self._halts[0] += 1
            else:
                await self._write(address, words, judged=name not in _WHATEVER_IT_IS)
        except LINE_ERRORS as error:
            if error.started is None:
                if not urgent:
                    raise
                raise type(error)(
                    f"{name} could not be sent to unit {self.unit} ({error}); {_MAY[name]}",
                    unit=self.unit,
                    request=error.request,
                    ended=error.ended,
                ) from error
            self._halts[0] += urgent
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
            return f"State seen afterwards: {await self._glance(urgent=urgent)}"
        except (*LINE_ERRORS, Refused) as error:
            return f"Its state could not be read afterwards either ({type(error).__name__}); {self._seen_last()}"

    async def _confirm(
        self, command: str, shows: Callable[[Seen], Awaitable[bool]], within: float, fall: Fall | None = None
    ) -> None:
        """Looks until the drive *shows* the command, for *within* seconds, and as long as a *fall* is worth a look."""
        if within == 0 or self._planned_look().plan is None:
            return
        deadline = self.bus.now() + within
        while True:
            try:
                seen = await self._glance(urgent=command in HALTS and self.bus.now() <= deadline)
                if await shows(seen):
                    return
                last = f"state seen last: {seen}"
                if fall is not None and fall.frequency is not None:
                    last += f", at {fall.frequency:g} Hz"
                source = seen.source
                if source not in (ControlSource.COMMUNICATION, None):
                    last += f", with commands from the {source}"
                # A motor that was told to stop is looked at: some drives run on in a fault.
                if seen.fault is not None and command not in (*HALTS, "reset_fault"):
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
            if self.bus.now() >= (deadline if fall is None else fall.until):
                break
            await self.bus.sleep(POLL_INTERVAL)
        raise Unconfirmed(
            f"{command} was sent to unit {self.unit}, and its state does not show it: {_MAY[command]}; {last}. "
            "It was not repeated",
            unit=self.unit,
        )


def _both_unusable(evidence: Evidence) -> str | None:
    """Why a motor could not be stopped; None if it could."""
    return evidence.unusable("stop") and evidence.unusable("coast")
