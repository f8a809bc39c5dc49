"""What people tell drives through the service, by whatever door: checked, carried out once, and answered for.

Who set a motor in motion answers for it: when that door is shut, or the service ends, its motors are halted.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from drivebus.bus import Bus
from drivebus.drive import Drive
from drivebus.errors import DrivebusError, NotAllowed, Refused
from drivebus.motor import Motor
from drivebus.service.events import Events
from drivebus.service.handles import handle_of
from drivebus.sinks.order_words import HALTS, ORDERS
from drivebus.site import SiteDrive

__all__ = ["Door", "Order", "Orders", "Outcome", "Result"]

_AT_ONCE = 2
"""So many halts of one drive are under way at a time. A drive that is silent is told for seconds, before all others on
its line, and people press on."""
_TRIES_AGAIN = 1.0
"""Seconds until a motor is halted again that did not take it, when its door is shut."""

Result = Literal["done", "refused", "not sent", "may have been done"]
"""What became of an order. Only of the last it is not known."""


class Order(NamedTuple):
    """What a drive is told.

    Attributes:
        drive: Its name in the file.
        what: One of `ORDERS`.
        hz: Of a run its speed, where it is given with it; of a setpoint the setpoint.
        reverse: Whether a run turns the other way.
    """

    drive: str
    what: str
    hz: float | None = None
    reverse: bool = False


class Outcome(NamedTuple):
    """What became of an order.

    Attributes:
        result: In one word, or a few.
        text: What the drive, or whoever did not send it, says.
    """

    result: Result
    text: str


@dataclass(frozen=True)
class Door:
    """Where orders come in.

    Attributes:
        name: What it is called, in events and answers.
        may: What may be ordered through it, by the names of drives: of `ORDERS`. Halts need not be named.
    """

    name: str
    may: Mapping[str, frozenset[str]]

    def why_not(self, order: Order) -> str:
        """Why *order* may not be given here, in words; empty if it may."""
        allowed = self.may.get(order.drive, frozenset())
        wanted = {order.what} if order.what != "run" or order.hz is None else {"run", "setpoint"}
        if allowed and order.what in HALTS:
            return ""
        lacking = sorted(wanted - allowed)
        return f"nobody may {' or '.join(lacking)} it here" if lacking else ""


@dataclass
class _Charge:
    """One drive that may be told something, as long as its line is open."""

    drive: Drive
    motor: Motor
    lock: threading.Lock = field(default_factory=threading.Lock)
    halts: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(_AT_ONCE))
    door: str = ""
    """Whose door it was set in motion by."""
    halted: object = None
    """Another one each time that it is told to halt."""


class Orders:
    """Carries out what is ordered. Any thread; it returns when that is done, or known not to be.

    Args:
        drives: Those of the site, by name.
        events: Hears of each order, and what became of it.
        clock: A clock in seconds that only goes forward.
    """

    def __init__(
        self, drives: Mapping[str, SiteDrive], events: Events, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._drives = drives
        self._events = events
        self._clock = clock
        self._charges: dict[str, _Charge] = {}

    def begin(self, bus: Bus, line: str, stack: ExitStack) -> None:
        """The drives of *line* can be told something, until *stack* is closed: what was set in motion is halted then.

        Raises:
            NotAllowed: One of them cannot be a drive of its profile.
        """
        for name, each in self._drives.items():
            if each.line.name == line and each.profile is not None and not each.read_only:
                drive = handle_of(bus, each)
                self._charges[name] = _Charge(drive, stack.enter_context(drive.motor()))
                stack.callback(self._end, name)

    def give(self, door: Door, order: Order, who: str, until: float) -> Outcome:
        """Carries *order* out, which *who* gave at *door*; once, and not if it is later than *until* by the clock."""
        outcome = self._carried_out(door, order, until)
        self._events.note(order.drive, "order", f"{who} by {door.name}: {_in_words(order)}: {_told(outcome)}")
        return outcome

    def stop_all(self, door: Door, who: str, within: float | None = None) -> dict[str, Outcome]:
        """Stops every drive that may be stopped at *door*, side by side.

        What became of it is told after *within* seconds at the latest, if that is given. Those that did not answer are
        told on, and an event says what became of that.
        """
        names = [name for name, allowed in door.may.items() if allowed]
        slow = Outcome("may have been done", "it is told again and again, and has not answered yet")
        found = dict.fromkeys(names, slow)

        def stop(name: str) -> None:
            found[name] = self.give(door, Order(name, "stop"), who, self._clock())

        threads = [threading.Thread(target=stop, args=(name,), daemon=True) for name in names]
        for thread in threads:
            thread.start()
        end = None if within is None else time.monotonic() + within
        for thread in threads:
            thread.join(None if end is None else max(end - time.monotonic(), 0.0))
        return dict(found)

    def started_by(self, door: str) -> list[str]:
        """The drives that were set in motion by *door*, and not halted since."""
        return [name for name, each in list(self._charges.items()) if each.door == door and each.motor.may_turn]

    def shut(self, door: str, why: str, is_over: Callable[[], bool]) -> None:
        """Halts what was set in motion by *door*, again and again until each drive takes it or all *is_over*."""
        for name in self.started_by(door):
            self._events.note(name, "order", f"halted, for {door} {why}")
            threading.Thread(target=self._until_halted, args=(name, door, is_over), daemon=True).start()

    def _until_halted(self, name: str, door: str, is_over: Callable[[], bool]) -> None:
        pause = threading.Event()
        while not is_over():
            charge = self._charges.get(name)
            if charge is None or charge.door != door or not charge.motor.may_turn:
                return
            try:
                charge.halted = object()
                self._halt(charge, "stop")
            except DrivebusError as error:
                self._events.note(name, "order", f"not halted yet: {error}")
                pause.wait(_TRIES_AGAIN)
            else:
                self._events.note(name, "order", "halted")
                return

    def _carried_out(self, door: Door, order: Order, until: float) -> Outcome:
        if order.what not in ORDERS:
            return Outcome("not sent", f"there is no order {order.what!r}; there are {', '.join(ORDERS)}")
        if order.drive not in self._drives:
            return Outcome("not sent", f"there is no drive {order.drive!r}")
        if why := door.why_not(order):
            return Outcome("not sent", why)
        charge = self._charges.get(order.drive)
        if charge is None:
            return Outcome("not sent", self._why_away(order.drive))
        before = charge.halted
        try:
            if order.what in HALTS:
                # Whatever waits, and was ordered before, is not sent any more.
                charge.halted = object()
                with _if_free(charge.halts) as is_free:
                    if not is_free:
                        return Outcome("may have been done", "it is being told already, and has not answered yet")
                    self._halt(charge, order.what)
            else:
                with charge.lock:
                    self._in_time(charge, until)
                    if charge.halted is not before:
                        raise NotAllowed("it was told to halt meanwhile")
                    self._do(charge, order, door)
                    if order.what == "run" and charge.halted is not before:
                        # The halt may have come just before the start was sent.
                        charge.motor.stop()
                        raise NotAllowed("it was told to halt meanwhile, and was stopped once more")
        except Refused as error:
            return Outcome("may have been done" if error.may_have_taken else "refused", str(error))
        except DrivebusError as error:
            return Outcome("may have been done" if error.may_have_taken else "not sent", str(error))
        return Outcome("done", "")

    def _why_away(self, name: str) -> str:
        if self._drives[name].read_only:
            return "it is read_only in the file"
        return "it has no profile in the file" if self._drives[name].profile is None else "its line is away"

    def _in_time(self, charge: _Charge, until: float) -> None:
        """Waits for the line with a read, so that what had to wait too long for it is known before it is sent."""
        if self._clock() <= until:
            charge.drive.ping()
        if self._clock() > until:
            raise NotAllowed("it came too late, or had to wait too long for the line")

    def _do(self, charge: _Charge, order: Order, door: Door) -> None:
        if order.what == "run":
            # Before it is sent: of what may turn it is to be known by whom.
            charge.door = door.name
            charge.motor.run(order.hz, reverse=order.reverse)
        elif order.what == "setpoint":
            if order.hz is None:
                raise NotAllowed("a setpoint needs a frequency in Hz")
            charge.drive.write_setpoint(order.hz)
        else:
            charge.drive.reset_fault()

    def _halt(self, charge: _Charge, what: str) -> None:
        halt = charge.drive.coast if what == "coast" else charge.drive.stop
        with _if_free(charge.lock) as is_free:
            if not is_free:
                # Somebody is at it: the halt overtakes that, and what is not sent of it yet is not sent any more.
                halt()
                return
            if what == "coast":
                halt()
            if what == "stop" or charge.motor.may_turn:
                charge.motor.stop()
            charge.door = ""

    def _end(self, name: str) -> None:
        with suppress(KeyError):
            del self._charges[name]


@contextmanager
def _if_free(lock: threading.Lock | threading.Semaphore) -> Iterator[bool]:
    taken = lock.acquire(blocking=False)
    try:
        yield taken
    finally:
        if taken:
            lock.release()


def _in_words(order: Order) -> str:
    speed = "" if order.hz is None else f" {'to' if order.what == 'setpoint' else 'at'} {order.hz:g} Hz"
    way = " in reverse" if order.reverse else ""
    return f"{order.what}{way}{speed}"


def _told(outcome: Outcome) -> str:
    return f"{outcome.result}: {outcome.text}" if outcome.text else outcome.result
