"""What a program can say about time: units that need more of it, and values that are none."""

from collections.abc import Iterator
from typing import Any

import pytest

import drivebus


@pytest.fixture
def bus() -> Iterator[drivebus.Bus]:
    with drivebus.Bus("sim://1=gd350,2=gd350?clock=virtual") as bus:
        yield bus


def test_a_unit_can_be_given_its_own_silence(bus: drivebus.Bus) -> None:
    bus.read(1, 0x2100)
    _, _, before = bus.read_stamped(1, 0x2100)
    bus.configure(1, gap=0.25)
    _, sent, _ = bus.read_stamped(1, 0x2100)
    assert sent - before == pytest.approx(0.25, abs=1e-6)
    bus.configure(1)
    _, _, before = bus.read_stamped(1, 0x2100)
    _, sent, _ = bus.read_stamped(1, 0x2100)
    assert sent - before == pytest.approx(bus.format.t35, abs=1e-6)


def test_a_unit_can_be_given_its_own_time_out(bus: drivebus.Bus) -> None:
    bus.read(1, 0x2100)
    bus.configure(1, timeout=0.05)
    assert bus.simulator is not None
    bus.simulator.line.set_faults(silence=1.0)
    with pytest.raises(drivebus.NoAnswer, match="50 ms"):
        bus.read(1, 0x2100)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"unit": 0}, "unit"),
        ({"unit": 248}, "1 to 247"),
        ({"unit": 1, "timeout": 0}, "timeout"),
        ({"unit": 1, "timeout": float("nan")}, "timeout"),
        ({"unit": 1, "gap": -1}, "gap"),
        ({"unit": 1, "gap": "long"}, "gap"),
    ],
)
def test_what_is_no_time_is_refused(bus: drivebus.Bus, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(drivebus.NotAllowed, match=message):
        bus.configure(**arguments)


def test_the_turnaround_is_the_buss_own() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual", turnaround=0.4) as bus:
        start = bus.now()
        bus.broadcast(0x2000, 5)
        assert bus.now() - start == pytest.approx(0.4 + bus.format.t35 + 8 * bus.format.char_time, abs=1e-6)
    with pytest.raises(drivebus.NotAllowed, match="turnaround"):
        drivebus.Bus("sim://gd350", turnaround=-1)


def test_the_delay_of_a_unit_is_counted(bus: drivebus.Bus) -> None:
    bus.read(1, 0x2100)
    bus.read(1, 0x2100)
    delay = bus.stats().units[1].delay
    assert delay.min == pytest.approx(0.005 + bus.format.t35, abs=1e-6)  # P14.03, as delivered
