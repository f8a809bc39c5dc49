"""A halt on its way: sent until the unit takes it, one frame after another, for as long as was said.

A halt that was lost, refused because a frame arrived damaged, or put off by a drive that is busy, halts nothing. So it
is sent again: every halt is an absolute word, and a motor that was told twice to stop stops once. What ends it is a
confirmation, or the time. Nothing else that moves a motor is ever repeated.
"""

from __future__ import annotations

from collections.abc import Sequence

from drivebus.errors import LINE_ERRORS, BadAnswer, DrivebusError, NoAnswer, NotAllowed, PortError, Refused, Unconfirmed
from drivebus.identify.harm import harmed
from drivebus.line.frames import may_be_of
from drivebus.operations import commands, events, raw_words, state
from drivebus.operations.aim import ANSWER_WITHIN, Aim, Target
from drivebus.operations.drive_view import DriveView

__all__ = ["WITHIN", "Halt"]

WITHIN = 10.0
"""Seconds for which a halt is sent that is not taken."""

_PAUSE = 0.04
"""Seconds of the line's clock between a frame that came to nothing at once, and the next."""


_ASKED_FOR = 1.0
"""Seconds of the line's clock for which a unit that does not show a halt is asked what it is, while it is not heard."""


_TO_SAY = 2.0
"""Seconds of the line's clock in which a unit says what it is, on a line that was just opened and loses an answer. One
question alone takes a second there."""


class Halt:
    """One unit that is to be halted.

    Args:
        unit: The unit, as it was named.
        rota: The commands to send, one after another, from the first again behind the last.
        within: Seconds for which they are sent.

    Attributes:
        unit: The unit, as the family that it is taken for.
        command: What was sent last.
        sent: The line's clock before the frame that was taken.
        confirmed: The line's clock when it was.
        is_taken: Whether one was.
        is_confirmed: Whether it confirmed that; a unit may also say that it is still at it, and show nothing.
    """

    def __init__(self, unit: DriveView, rota: Sequence[str], within: float) -> None:
        self.unit = unit
        self.command = rota[0]
        self.sent = self.confirmed = unit.bus.now()
        self.is_taken = self.is_confirmed = False
        self._named = unit
        self._aim = Aim(unit)
        self._rota = rota
        self._within = within
        self._began = self.sent
        self._until = self.sent + within
        self._told: list[str] = []
        self._heard: float | None = None
        self._failure: DrivebusError | None = None

    @property
    def is_over(self) -> bool:
        """Whether its time has passed. A unit that speaks, and did not say yet what it is, is given the time to."""
        now = self.unit.bus.now()
        is_asked = self._heard is not None and not self._told and not self.unit.bus.closed
        return now >= (max(self._until, self._began + _TO_SAY) if is_asked else self._until)

    async def until_taken(self) -> None:
        """Sends until the unit takes it.

        Raises:
            NotAllowed: What the unit is cannot be told, and the command might start it. It was not sent.
            Refused, NoAnswer, BadAnswer, PortError, Unconfirmed: Nothing was taken within the time.
        """
        while not await self.step():
            if self.is_over:
                raise await self.failure() from self._failure
            await self.unit.bus.sleep(_PAUSE)

    async def step(self) -> bool:
        """Sends once. Whether the unit took it.

        Raises:
            NotAllowed: As for `until_taken`.
        """
        wanted = self._rota[len(self._told) % len(self._rota)]
        try:
            target = await self._aim.take(wanted)
            if target is None:
                self._heard = self.unit.bus.now()
                return False
            self.unit, self.command = target
            await self._send(target)
        except Refused as error:
            self._heard, self._failure = self.unit.bus.now(), error
            self._doubt_named()
        except LINE_ERRORS as error:
            if isinstance(error, BadAnswer) and may_be_of(self.unit.address, error.raw):
                self._heard = self.unit.bus.now()
            # That one went out tells more than that a later one could not.
            if error.started is not None or self._failure is None or self._failure.started is None:
                self._failure = error
            if isinstance(error, PortError) and self.unit.bus.closed:
                self._until = self.unit.bus.now()
        else:
            self.is_taken = True
        return self.is_taken

    def _doubt_named(self) -> None:
        """A halt was refused. A unit that did not say yet what it is may refuse it because it is of another family."""
        if self.unit.profile is self._named.profile and not self.unit.identity.is_known(self.unit.bus):
            self._aim.doubt()

    async def vouch(self) -> None:
        """Makes sure that what was halted is what the unit says it is. Where it is not, it is halted as that.

        Asks nothing of a unit that this line has identified, or that was halted as what it showed.

        Raises:
            Unconfirmed: The unit does not say what it is, or only what it is not: the motor may still turn.
            NotAllowed, Refused, NoAnswer, BadAnswer, PortError: As for `until_taken`.
        """
        unit, named = self.unit, self._named
        if unit.profile is not named.profile or unit.identity.is_known(unit.bus):
            return
        against = await self._contradiction()
        if against is None:
            return
        self._aim.doubt()
        self.is_taken, self._until = False, unit.bus.now() + self._within
        try:
            await self.until_taken()
        except NotAllowed as error:
            raise self._is_another(f"{against}, and {error}") from error

    async def vouch_anew(self) -> bool:
        """Whether it was halted once more, as another family: it does not show the halt, and shows that family now.

        A port that stayed open may have another drive behind it, whatever the line knew of the one before. Where no
        answer comes it is asked again, until none has come for a second: an answer that was lost is no reason to let it
        run.

        Raises:
            Unconfirmed: What it is now cannot be told, but that it is not what was halted: the motor may still turn.
            Refused, NoAnswer, BadAnswer, PortError: As for `until_taken`.
        """
        if not self._aim.doubt():
            return False
        bus, aim = self.unit.bus, self._aim
        began = heard = bus.now()
        try:
            while (target := await aim.take(self.command)) is None:
                # One question alone may take seconds: what it heard before the last counts.
                is_silent = aim.heard <= heard and bus.now() >= heard + _ASKED_FOR
                if is_silent or bus.now() >= began + self._within:
                    break
                heard = max(heard, aim.heard)
                await bus.sleep(_PAUSE)
        except PortError:
            return False
        except NotAllowed as error:
            raise self._is_another(str(error)) from error
        if target is None or target.unit.profile is self.unit.profile:
            return False
        self.unit.identity.is_another()
        self.is_taken, self._until = False, self.unit.bus.now() + self._within
        await self.until_taken()
        return True

    async def was_another(self) -> bool:
        """Whether it was halted once more, as another family, although it showed the halt: in the words of that one.

        Asks nothing of a unit that said lately what it is, nor where the halt does no harm to any family.
        """
        unit = self.unit
        if not unit.identity.is_old(unit.bus) or not harmed(unit.profile, self.command):
            return False
        try:
            against = await unit.identity.contradiction(unit.bus, urgent=True)
        except LINE_ERRORS:
            # What it showed stands: nothing speaks against it.
            return False
        return against is not None and await self.vouch_anew()

    def _is_another(self, what: str) -> Unconfirmed:
        unit = self.unit
        return Unconfirmed(
            f"{commands.said(self.command)} was sent to unit {unit.address} and taken; but {what}. "
            f"{commands.MAY[self.command]}",
            unit=unit.address,
        )

    async def _contradiction(self) -> str | None:
        """What the unit says against its name; asked for until it is answered, for as long as a halt is sent."""
        unit, until = self.unit, self.unit.bus.now() + self._within
        while True:
            try:
                return await unit.identity.contradiction(unit.bus, urgent=True)
            except LINE_ERRORS as error:
                if unit.bus.now() >= until or unit.bus.closed:
                    raise Unconfirmed(
                        f"{commands.said(self.command)} was sent to unit {unit.address} and taken, and what the unit "
                        f"is could not be asked ({error}): by another family it may mean something else; "
                        f"{commands.MAY[self.command]}; {state.seen_last(unit)}",
                        unit=unit.address,
                    ) from error
                await unit.bus.sleep(_PAUSE)

    async def _send(self, target: Target) -> None:
        unit, command = target
        profile, record = unit.profile, unit.record
        unit.evidence.require_command(command)
        record.halts_begun += 1
        self._told.append(command)
        self.sent = unit.bus.now()
        first = profile.command_first(command)
        # The line knows the unit by its name, and would hold the words of another family back.
        is_another = profile is not self._named.profile
        self.is_confirmed = True
        for address, code in (*(() if first is None else (first,)), profile.command(command)):
            try:
                self.is_confirmed &= await raw_words.send(
                    unit, address, code, urgent=True, timeout=ANSWER_WITHIN, force=is_another
                )
            except DrivebusError as error:
                record.halts += error.started is not None
                raise
        record.halts += 1
        self.confirmed = unit.bus.now()
        events.took(unit, commands.said(command))

    async def failure(self) -> DrivebusError:
        """Why nothing was taken, in words."""
        unit, error, took = self.unit, self._failure, self.unit.bus.now() - self._began
        may = commands.MAY[self.command]
        told = " or ".join(map(commands.said, dict.fromkeys(self._told)))
        times = f"{len(self._told)} times within {took:.1f} s" if len(self._told) != 1 else "once"
        if isinstance(error, Refused):
            return Refused(
                f"{told} was sent to unit {unit.address} {times} and not taken, at last: {error}; {may}. "
                f"{await commands.state_afterwards(unit, urgent=True)}",
                code=error.code,
                name=error.name,
                meaning=error.meaning,
                means=error.means,
                unit=unit.address,
                **commands.frames_of(error),
            )
        if isinstance(error, (NoAnswer, BadAnswer, PortError)):
            if error.started is None:
                return type(error)(
                    f"{commands.said(self.command)} could not be sent to unit {unit.address} ({error}); {may}",
                    unit=unit.address,
                    request=error.request,
                    ended=error.ended,
                )
            silent = "nothing came from it at all"
            if self._heard is not None:
                silent = f"the last that came from it came {unit.bus.now() - self._heard:.1f} s ago"
            return Unconfirmed(
                f"{told} was sent to unit {unit.address} {times} and not confirmed ({error}): {silent}; {may}. "
                f"{await commands.state_afterwards(unit, urgent=True)}",
                unit=unit.address,
                **commands.frames_of(error),
            )
        return Unconfirmed(
            f"unit {unit.address} is busy, and does not say what it is: {self.command} was not sent, for it may start "
            f"a drive of another family; {may}, {state.seen_last(unit)}. If it must stop now, use the emergency stop",
            unit=unit.address,
        )
