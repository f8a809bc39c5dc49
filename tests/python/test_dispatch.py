"""Orders that must not wait for each other: one drive after the other would be, and halts before all."""

from __future__ import annotations

import threading
from collections.abc import Callable

from drivebus.service.dispatch import Dispatch
from drivebus.service.orders import Door, Order, Outcome

from .tcp_client import seen

DOOR = Door("mqtt", {"pump": frozenset({"run", "setpoint", "reset"}), "fan": frozenset({"run"})})
DONE = Outcome("done", "")


class Slow:
    """Carries out what it is told to let go on."""

    def __init__(self) -> None:
        self.given: list[tuple[str, str]] = []
        self.held: dict[str, threading.Event] = {}

    def give(self, door: Door, order: Order, who: str, until: float) -> Outcome:  # noqa: ARG002
        self.given.append((order.drive, order.what))
        if order.what in self.held:
            self.held[order.what].wait(60)
        return DONE


def into(outcomes: dict[str, Outcome], name: str) -> Callable[[Outcome], None]:
    return lambda outcome: outcomes.__setitem__(name, outcome)


def test_a_drive_that_is_slow_holds_no_other_one_up() -> None:
    slow, told = Slow(), dict[str, Outcome]()
    slow.held["reset"] = threading.Event()
    dispatch = Dispatch(slow, DOOR)
    dispatch.give(Order("pump", "reset"), "me", 1.0, into(told, "first"))
    dispatch.give(Order("pump", "setpoint", 10.0), "me", 1.0, into(told, "second"))
    dispatch.give(Order("fan", "run"), "me", 1.0, into(told, "other"))
    seen(lambda: "other" in told)
    assert slow.given == [("pump", "reset"), ("fan", "run")] or slow.given == [("fan", "run"), ("pump", "reset")]
    slow.held["reset"].set()
    seen(lambda: "second" in told)
    assert set(told.values()) == {DONE}
    assert slow.given[-1] == ("pump", "setpoint")


def test_a_halt_goes_at_once_and_what_waits_is_not_carried_out() -> None:
    slow, told = Slow(), dict[str, Outcome]()
    slow.held["run"] = threading.Event()
    dispatch = Dispatch(slow, DOOR)
    dispatch.give(Order("pump", "run"), "me", 1.0, into(told, "run"))
    seen(lambda: slow.given == [("pump", "run")])
    dispatch.give(Order("pump", "run"), "me", 1.0, into(told, "waits"))
    dispatch.give(Order("pump", "stop"), "me", 1.0, into(told, "stop"))
    assert told["waits"] == Outcome("not sent", "a stop came after it")
    seen(lambda: "stop" in told)
    # Who knows whether the stop was through before: it is stopped once more.
    slow.held["run"].set()
    seen(lambda: "run" in told)
    assert slow.given == [("pump", "run"), ("pump", "stop"), ("pump", "stop")]


def test_so_many_wait_at_most() -> None:
    slow, told = Slow(), list[Outcome]()
    for what in ("run", "stop"):
        slow.held[what] = threading.Event()
    dispatch = Dispatch(slow, DOOR)
    for _ in range(20):
        dispatch.give(Order("pump", "run"), "me", 1.0, told.append)
    # One is under way, unless it has not begun yet.
    assert len(told) in (11, 12)
    assert set(told) == {Outcome("not sent", "too many orders wait for this drive")}
    told.clear()
    for _ in range(20):
        dispatch.give(Order("pump", "stop"), "me", 1.0, told.append)
    assert sum("too many" in each.text for each in told) == 16
    for each in slow.held.values():
        each.set()
    seen(lambda: slow.given.count(("pump", "stop")) == 5)
