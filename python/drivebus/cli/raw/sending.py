"""Requests on the line: asked about before, shown with their answers, counted for whoever interrupts them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import drivebus
from drivebus.cli.present.errors import tell
from drivebus.cli.present.frames import show_frame
from drivebus.cli.present.output import remark
from drivebus.cli.raw.families import UnitFamilies
from drivebus.cli.raw.request import Request
from drivebus.cli.raw.script import Send, Step, Wait, located
from drivebus.cli.session import Session, ask_once
from drivebus.rtu import framed

__all__ = ["Sender"]


_HARMLESS = ("s", "ms", "min", "h", "kHz", "V", "A", "kW")
"""Units of parameters that move no motor that stands."""


class Sender:
    """Sends what lines ask for, and shows it.

    Args:
        session: The options before the command.
        bus: The line.
        families: What the units are.
        force: Whether commands go out that the family does not define.
        yes: Whether nobody is asked.

    Attributes:
        sent: Requests of the latest run that were answered or given up.
        failed: How many of them got no answer, a bad one, or a refusal.
        under_way: Whether one was begun and is in neither count: it was interrupted.
        moved: Whether a command was sent that can move a motor.
    """

    def __init__(self, session: Session, bus: drivebus.Bus, families: UnitFamilies, force: bool, yes: bool) -> None:
        self._session = session
        self._bus = bus
        self._families = families
        self._force = force
        self._yes = yes
        self.sent = self.failed = 0
        self.under_way = False
        self.moved = False

    def prepare(self, steps: Sequence[Step], count: int = 1) -> None:
        """Checks all that *steps* would send, *count* times, and asks about what writes: once for all of it.

        Raises:
            NotAllowed: Something may not be sent; nothing was.
            Declined, click.UsageError: It is not wanted, or nobody can be asked.
        """
        writes: Counter[Request] = Counter()
        for step in steps:
            if isinstance(step, Send):
                with located(step.where):
                    for request in step.requests:
                        self._families.check(request, self._force)
                        if request.writes:
                            writes[request] += step.times * count
        moves = ", which can move the motor" if any(map(self._could_move, writes)) else ""
        if len(writes) == 1:
            [(request, times)] = writes.items()
            self._session.ask(f"This sends {self._told(request, times)}{moves}", self._yes, request.unit)
        elif writes:
            rows = [f"  unit {request.unit}: {self._told(request, times)}" for request, times in writes.items()]
            ask_once([f"On {self._session.port} this sends{moves}:", *rows], self._yes)

    def _could_move(self, request: Request) -> bool:
        """Whether *request* may move the motor, for all that is known: parameters that cannot are the exception.

        A speed or a share may be the setpoint of a motor that turns, and what has choices may decide who starts it.
        """
        write, profile = drivebus.rtu.written(request.pdu), self._families.known(request.unit)
        if write is None or profile is None:
            return True
        names = [profile.name_at(profile.plain_address(write[0] + place)) for place in range(len(write[1]))]
        rows = [None if name is None else profile.describe(name) for name in names]
        return not all(row and row.kind == "parameter" and row.unit in _HARMLESS and not row.choices for row in rows)

    def _told(self, request: Request, times: int) -> str:
        means = request.meaning(self._families.known(request.unit))
        return f"{request.text()} ({means}){'' if times == 1 else f' {times} times'}"

    def run(
        self, steps: Sequence[Step], count: int = 1, interval: float | None = None, keep_going: bool = False
    ) -> drivebus.DrivebusError | None:
        """Sends *steps*, *count* times, every *interval* seconds; tells what fails, and returns the first error.

        It ends at the first error unless it is to keep going; where the port fails, in any case.
        """
        self.sent = self.failed = 0
        self.under_way = False
        first = None
        for _ in self._paced(count, interval):
            for step in steps:
                if isinstance(step, Wait):
                    self._bus.sleep(step.seconds)
                    continue
                for _ in self._paced(step.times, step.every):
                    for request in step.requests:
                        error = self._sent(request)
                        if error is None:
                            continue
                        tell(error, step.where)
                        first = first or error
                        if not keep_going or isinstance(error, drivebus.PortError):
                            return first
        return first

    def _paced(self, times: int, every: float | None) -> Iterator[int]:
        """Counts to *times*; the beginnings are *every* seconds apart, and do not drift."""
        begun = self._bus.now()
        for number in range(times):
            if number and every:
                self._bus.sleep(max(begun + number * every - self._bus.now(), 0.0))
            yield number

    def _sent(self, request: Request) -> drivebus.DrivebusError | None:
        """Sends *request* and shows it and its answer; returns what is wrong with that."""
        out, profile, frame = self._session.out, self._families.known(request.unit), framed(request.body)
        self.moved |= self._may_move(request)
        self.under_way = True
        try:
            answer = self._bus.transact(request.unit, request.pdu, force=self._force)
        except drivebus.NotAllowed:
            self.under_way = False
            raise
        except drivebus.DrivebusError as error:
            self._count(False)
            show_frame(out, "sent", frame, True, profile=profile)
            if isinstance(error, drivebus.Refused):
                show_frame(out, "answer", error.raw, False, frame, profile)
                if profile is not None:
                    name, told = profile.exception(error.code)
                    out.say(f"{'':<7}{profile.name} means by it: {name}, {told}")
            return error
        self._count(True)
        show_frame(out, "sent", frame, True, profile=profile)
        show_frame(out, "answer", framed(bytes([request.unit]) + answer), False, frame, profile)
        return None

    def _count(self, answered: bool) -> None:
        self.under_way = False
        self.sent += 1
        self.failed += not answered

    def _may_move(self, request: Request) -> bool:
        """Whether *request* writes to what is a command register, of the unit's family or of any."""
        places = [first + at for first, words in drivebus.rtu.may_write(request.pdu) for at in range(len(words))]
        if not places:
            return False
        known = self._families.known(request.unit)
        families = [known] if known else [drivebus.Profile.builtin(name) for name in drivebus.profiles()]
        return any(family.is_command(place) for family in families for place in places)

    def told(self, total: int) -> str:
        """How many of *total* requests were sent, and how many failed."""
        counted = f"{self.sent} of {total} requests were sent" if self.sent < total else f"{total} requests were sent"
        way = ", and one more was under way" if self.under_way else ""
        return f"{counted}{f', {self.failed} without a good answer' if self.failed else ''}{way}."

    def remind(self) -> None:
        """Says how to stop a motor, where a command was sent."""
        if self.moved:
            remark(f"A motor that was started keeps running: `{self._session.command('stop')}` stops it.")
