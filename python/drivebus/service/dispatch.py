"""Orders on their way from a door that must not wait: those of one drive one after the other, and halts at once.

A drive that does not answer holds no other one up. What waits when a halt comes is not carried out any more.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

from drivebus.service.orders import Door, Order, Outcome
from drivebus.sinks.order_words import HALTS

__all__ = ["Dispatch"]

_WAITING = 8
"""Orders that wait for one drive."""
_HALTING = 4
"""Halts of one drive that are under way."""


class _Gives(Protocol):
    """Carries orders out, as `Orders` does."""

    def give(self, door: Door, order: Order, who: str, until: float) -> Outcome: ...


class _Given(NamedTuple):
    order: Order
    who: str
    until: float
    done: Callable[[Outcome], None]


@dataclass
class _Queue:
    """The orders of one drive."""

    waiting: deque[_Given] = field(default_factory=deque)
    is_busy: bool = False
    halting: int = 0
    halts: int = 0
    """How many halts came."""


class Dispatch:
    """Hands orders on. It never waits; what comes of each is told in a thread of its own.

    Args:
        orders: Carries them out.
        door: By which they come.
    """

    def __init__(self, orders: _Gives, door: Door) -> None:
        self._orders = orders
        self._door = door
        self._lock = threading.Lock()
        self._queues: dict[str, _Queue] = {}

    def give(self, order: Order, who: str, until: float, done: Callable[[Outcome], None]) -> None:
        """Has *order* carried out, which *who* gave, if it is sent by *until*; *done* is called once."""
        given = _Given(order, who, until, done)
        dropped: list[_Given] = []
        work: Callable[[_Queue, _Given], None]
        with self._lock:
            queue = self._queues.setdefault(order.drive, _Queue())
            if order.what in HALTS:
                dropped, queue.waiting = list(queue.waiting), deque()
                queue.halts += 1
                is_taken = queue.halting < _HALTING
                queue.halting += is_taken
                work = self._halt
            else:
                is_taken = len(queue.waiting) < _WAITING
                begins = is_taken and not queue.is_busy
                if is_taken:
                    queue.waiting.append(given)
                    queue.is_busy = True
                work = self._work
        for each in dropped:
            each.done(Outcome("not sent", f"a {order.what} came after it"))
        if not is_taken:
            done(Outcome("not sent", "too many orders wait for this drive"))
        elif order.what in HALTS or begins:
            threading.Thread(target=work, args=(queue, given), daemon=True).start()

    def _halt(self, queue: _Queue, given: _Given) -> None:
        try:
            outcome = self._orders.give(self._door, given.order, given.who, given.until)
        finally:
            with self._lock:
                queue.halting -= 1
        given.done(outcome)

    def _work(self, queue: _Queue, _: _Given) -> None:
        while True:
            with self._lock:
                if not queue.waiting:
                    queue.is_busy = False
                    return
                given, halts = queue.waiting.popleft(), queue.halts
            outcome = self._orders.give(self._door, given.order, given.who, given.until)
            with self._lock:
                is_halted = queue.halts != halts
            if is_halted and given.order.what == "run" and outcome.result in ("done", "may have been done"):
                # The halt may have been through before this began.
                self._orders.give(self._door, Order(given.order.drive, "stop"), given.who, given.until)
            given.done(outcome)
