"""The loop: pins in, a command at their change, a look at the drive, pins out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from drivebus.drive import Drive
from drivebus.errors import DrivebusError, NotAllowed, Refused, Unconfirmed
from drivebus.hal.core import Action, Run, Speed, Spindle
from drivebus.hal.linuxcnc import HalGone
from drivebus.hal.motor import SpindleMotor
from drivebus.hal.pins import Pins

__all__ = ["Loop"]

PERIOD = 0.05
"""Seconds of the line's clock from the start of one cycle to the next, where the line is fast enough."""


class Watch(Protocol):
    """Tells whether HAL is still there."""

    def gone(self, now: float, *, turning: bool) -> str: ...


class Loop:
    """Brings pins and drive together, a cycle at a time.

    Args:
        pins: Where what is wanted stands, and what is so goes.
        spindle: Decides.
        motor: Tells the drive.
        drive: The drive, for its line's clock.
        say: Is told what people have to know.
        watch: Tells whether HAL is still there; None does not look.
    """

    def __init__(
        self,
        pins: Pins,
        spindle: Spindle,
        motor: SpindleMotor,
        drive: Drive,
        say: Callable[[str], None],
        watch: Watch | None = None,
    ) -> None:
        self._pins, self._spindle, self._motor, self._bus = pins, spindle, motor, drive.bus
        self._say = say
        self._watch = watch
        self._known = False
        self._may_have_forgotten = False
        self._trouble = ""

    def forever(self) -> None:
        """Cycles until somebody ends it.

        Raises:
            HalGone: Nobody is left who could change a pin.
            NotAllowed: The drive takes no speed in Hz.
        """
        while True:
            begun = self._bus.now()
            self.cycle()
            self._bus.sleep(max(begun + PERIOD - self._bus.now(), 0.001))

    def cycle(self) -> None:
        """One cycle. Raises as `forever`."""
        spindle = self._spindle
        if self._watch is not None:
            gone = self._watch.gone(self._bus.now(), turning=spindle.told is not None)
            if gone:
                raise HalGone(gone)
        action = spindle.decide(self._bus.now(), self._pins.asked())
        if action is not None:
            # A brake opens before its motor turns, and nothing is at a speed that is about to change.
            self._pins.show({"at-speed": False, **({"brake": False} if isinstance(action, Run) else {})})
            self._carry_out(action)
        self._look()
        now = self._bus.now()
        shown = spindle.shown(now)
        self._pins.show(shown)
        self._keep_watchdog(bool(shown["link-ok"]), bool(shown["stopped"]))
        if spindle.trouble != self._trouble:
            self._trouble = spindle.trouble
            if self._trouble:
                self._say(self._trouble)

    def _carry_out(self, action: Action) -> None:
        try:
            self._motor.carry_out(action)
        except DrivebusError as error:
            final = isinstance(error, NotAllowed) or (isinstance(error, Refused) and error.is_decision)
            self._spindle.failed(action, str(error), final=final, sent=isinstance(error, Unconfirmed))
            self._trouble = self._spindle.trouble
            if final or not isinstance(action, Speed):
                self._say(f"{'the speed stays as it was: ' if isinstance(action, Speed) else ''}{error}")
        else:
            self._spindle.done(action, self._bus.now())

    def _look(self) -> None:
        try:
            look = self._motor.look()
            if not self._known:
                self._spindle.counts = self._motor.counts()
                self._known = True
        except NotAllowed:
            if not self._known:
                raise
            self._spindle.missed()
        except DrivebusError:
            self._spindle.missed()
        else:
            self._spindle.saw(look)

    def _keep_watchdog(self, linked: bool, stopped: bool) -> None:
        """A drive that was away may have been switched off: what it had in RAM is set again, at rest."""
        self._may_have_forgotten |= not linked
        if self._may_have_forgotten and stopped and self._spindle.told is None:
            self._motor.forget_watchdog()
            self._may_have_forgotten = False
