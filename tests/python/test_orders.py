"""Orders are carried out once, by whom they are allowed, in time; and who set a motor in motion answers for it."""

from __future__ import annotations

import itertools
import random
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import drivebus
from drivebus import Simulator
from drivebus.service.events import Events
from drivebus.service.orders import Door, Order, Orders
from drivebus.sinks.order_words import HALTS, ORDERS
from drivebus.site import Site

from .plant_text import HALL, drive
from .tcp_client import seen

PLANT = HALL + drive("pump", 1) + drive("fan", 2) + drive("meter", 3, "gd350", "read_only = true") + drive("ghost", 9)
ALL = frozenset(ORDERS)
DOOR = Door("page", {"pump": ALL, "fan": ALL, "meter": ALL})
CONTROL, FORWARD, REVERSE, STOP, COAST = 0x2000, 1, 2, 5, 6
SOON = 2.0


class Plant:
    """Two drives that obey the bus, and orders for them, with a clock that stands until it is set."""

    def __init__(self, tmp_path: Path, simulator: Simulator) -> None:
        file = tmp_path / "drivebus.toml"
        file.write_text(PLANT.format(port=simulator.port))
        self.now = 0.0
        self.simulator = simulator
        self.events = Events(lambda _: None, None)
        self.on_clock: Callable[[float], object] = bool
        self.orders = Orders(Site.load(file).drives, self.events, self.clock)

    def clock(self) -> float:
        self.on_clock(self.now)
        return self.now

    @contextmanager
    def line(self) -> Iterator[drivebus.Bus]:
        with ExitStack() as stack:
            bus = stack.enter_context(drivebus.Bus(self.simulator.port, baudrate=115200))
            self.orders.begin(bus, "hall", stack)
            yield bus

    def told(self, unit: int = 1) -> list[int]:
        """The commands that the drive was given."""
        return [value for _, address, value in self.simulator.drive(unit).writes() if address == CONTROL]

    def give(self, what: str, drive: str = "pump", **more: float | bool) -> tuple[str, str]:
        return self.orders.give(DOOR, Order(drive, what, **more), "maria", SOON)  # type: ignore[arg-type]


@pytest.fixture
def plant(tmp_path: Path) -> Iterator[Plant]:
    with Simulator({1: "gd350", 2: "gd350", 3: "gd350"}, transport="tcp", baudrate=115200) as simulator:
        with drivebus.Bus(simulator.port, baudrate=115200) as bus:
            for unit in (1, 2):
                motor = bus.drive(unit, "gd350")
                motor.prepare_control()
                motor.write({"P00.11": 0.5, "P00.12": 0.5})
        yield Plant(tmp_path, simulator)


def test_each_order_is_carried_out_once(plant: Plant) -> None:
    with plant.line():
        assert plant.give("run", hz=10.0) == ("done", "")
        assert plant.give("setpoint", hz=20.0) == ("done", "")
        assert plant.give("run", hz=5.0, reverse=True) == ("done", "")
        assert plant.give("coast") == ("done", "")
        assert plant.give("reset") == ("done", "")
        assert plant.told().count(FORWARD) == plant.told().count(REVERSE) == 1
        assert plant.told()[-2] == COAST
        assert plant.orders.started_by("page") == []
    assert [each.text for each in plant.events.last()][:2] == [
        "maria by page: run at 10 Hz: done",
        "maria by page: setpoint to 20 Hz: done",
    ]


def test_rights_are_those_of_the_door() -> None:
    """Against an oracle of a few lines: every order at every door that allows some of them."""
    for count in range(len(ORDERS) + 1):
        for allowed in map(frozenset, itertools.combinations(ORDERS, count)):
            door = Door("door", {"pump": allowed})
            for what, hz in itertools.product(ORDERS, (None, 10.0)):
                may = what in allowed and not (what == "run" and hz is not None and "setpoint" not in allowed)
                may = may or (what in HALTS and bool(allowed))
                assert (door.why_not(Order("pump", what, hz)) == "") == may
                assert door.why_not(Order("fan", what, hz)) != ""


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (Order("pump", "start"), "there is no order"),
        (Order("pumps", "run"), "there is no drive"),
        (Order("meter", "run"), "it is read_only"),
        (Order("pump", "setpoint"), "needs a frequency"),
        (Order("pump", "run", 9_999.0), "out of range"),
        (Order("pump", "run", float("nan")), "nan"),
        (Order("pump", "run", -3.0), "-3"),
    ],
)
def test_what_cannot_be_is_not_sent(plant: Plant, order: Order, why: str) -> None:
    with plant.line():
        before = len(plant.told())
        result, text = plant.orders.give(DOOR, order, "maria", SOON)
        assert result == "not sent"
        assert why in text
        assert len(plant.told()) == before
    assert plant.events.last()[-1].text.endswith(f"not sent: {text}")


def test_what_is_late_is_not_sent_and_a_stop_always_is(plant: Plant) -> None:
    with plant.line():
        plant.now = SOON + 0.001
        for what, hz in (("run", 10.0), ("setpoint", 10.0), ("reset", None)):
            assert plant.orders.give(DOOR, Order("pump", what, hz), "maria", SOON)[0] == "not sent"
        assert plant.told() == []
        assert plant.give("stop") == ("done", "")
        assert plant.told() == [STOP]


def test_a_line_that_is_away_takes_no_order(plant: Plant) -> None:
    assert plant.give("stop")[0] == "not sent"
    with plant.line():
        assert plant.give("stop")[0] == "done"
    assert plant.give("run")[0] == "not sent"


def test_a_stop_overtakes_a_start_and_one_motor_waits_for_no_other(plant: Plant) -> None:
    with plant.line():
        accepted, go_on = threading.Event(), threading.Event()
        times = itertools.count()

        def hold(_: object) -> None:
            # At its second look at the clock it has been at the drive, and is about to start it.
            if threading.current_thread() is starting and next(times) == 1:
                accepted.set()
                go_on.wait()

        plant.on_clock = hold
        given: list[tuple[str, str]] = []
        starting = threading.Thread(target=lambda: given.append(plant.give("run", hz=10.0)))
        starting.start()
        accepted.wait()
        assert plant.give("stop", "fan") == ("done", "")
        assert plant.give("stop") == ("done", "")
        go_on.set()
        starting.join()
        assert given == [("not sent", "it was told to halt meanwhile")]
        assert plant.told() == [STOP]
        assert plant.told(2) == [STOP]


@pytest.mark.parametrize("seed", range(5))
def test_a_stop_at_any_moment_of_a_start_is_the_last_word(plant: Plant, seed: int) -> None:
    with plant.line():
        begun = threading.Event()
        plant.on_clock = lambda _: begun.set()
        starting = threading.Thread(target=plant.give, args=("run",), kwargs={"hz": 10.0})
        starting.start()
        begun.wait()
        threading.Event().wait(random.Random(seed).random() * 0.05)
        assert plant.give("stop")[0] == "done"
        starting.join()
        assert plant.told()[-1] == STOP
        assert plant.orders.started_by("page") == []


def test_all_are_stopped_side_by_side(plant: Plant) -> None:
    with plant.line():
        plant.give("run", hz=10.0)
        plant.give("run", "fan", hz=10.0)
        told = plant.orders.stop_all(DOOR, "maria")
        assert {name: each.result for name, each in told.items()} == {
            "pump": "done",
            "fan": "done",
            "meter": "not sent",
        }
        assert plant.told()[-1] == plant.told(2)[-1] == STOP


def test_a_silent_drive_keeps_nobody_waiting(plant: Plant) -> None:
    """It is told on, and who presses once more is told so."""
    door = Door("page", {"pump": ALL, "ghost": ALL})
    with plant.line():
        told = plant.orders.stop_all(door, "maria", within=0.0)
        assert told["ghost"].result == "may have been done"
        seen(lambda: plant.told()[-1:] == [STOP])
        plant.orders.stop_all(door, "maria", within=0.0)

        def presses_again() -> bool:
            return "is being told already" in plant.orders.give(door, Order("ghost", "stop"), "maria", SOON).text

        seen(presses_again)
        seen(lambda: plant.orders.give(door, Order("pump", "stop"), "maria", SOON).result == "done")


def test_what_a_door_set_in_motion_is_halted_with_it(plant: Plant) -> None:
    with plant.line():
        plant.give("run", hz=10.0)
        plant.orders.give(Door("other", {"fan": ALL}), Order("fan", "run", 10.0), "john", SOON)
        plant.orders.shut("page", "is gone", lambda: False)
        seen(lambda: plant.told()[-1] == STOP)
        seen(lambda: plant.orders.started_by("page") == [])
        assert plant.orders.started_by("other") == ["fan"]
        assert STOP not in plant.told(2)
    assert plant.told(2)[-1] == STOP, "the end of the line halts what was set in motion"


def test_what_somebody_else_runs_is_left_alone(plant: Plant) -> None:
    with plant.line() as bus:
        bus.drive(1, "gd350").run(10.0)
        plant.orders.shut("page", "is gone", lambda: False)
    assert plant.told() == [FORWARD]
