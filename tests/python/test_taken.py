"""Did the drive take it? What an error tells of that, against the log of the drive itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import pytest

import drivebus
from drivebus import Bus, Drive, DrivebusError, Simulator

RAM = 0x800B
"""P00.11 in RAM: a ramp, which moves nothing."""
COMMAND = 0x2000


WAYS: dict[str, Callable[[Bus, Drive, int], object]] = {
    "write": lambda bus, _, value: bus.write(1, RAM, value),
    "several": lambda bus, _, value: bus.write(1, RAM, [value, 50]),
    "read back": lambda bus, _, value: bus.write(1, RAM, value, read_back=RAM & 0x7FFF),
    "pdu": lambda bus, _, value: bus.transact(1, b"\x06\x80\x0b" + value.to_bytes(2, "big")),
    "of a drive": lambda _, drive, value: drive.write_words(RAM, value),
    "set": lambda _, drive, value: drive.write("P00.11", value / 10),
}


@pytest.mark.parametrize("way", WAYS)
def test_what_an_error_says_was_not_taken_was_not(way: str) -> None:
    """With every fault of the line and the port, each write has a value of its own."""
    told: Counter[tuple[str, bool, bool]] = Counter()
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual", seed=32) as simulator,
        drivebus.Bus(simulator, retries=1, timeout=0.1) as bus,
    ):
        drive = bus.drive(1)
        simulator.line.set_faults(all=0.04, unplug=0.02)
        simulator.line.set_times(late=0.2, overtaken=(0.15, 0.3), replug=0.3)
        for value in range(50, 650):
            if value % 7 == 0:
                simulator.drive(1).refuse([0x06, 0x03][value % 2], asked="writes")
            try:
                WAYS[way](bus, drive, value)
            except DrivebusError as error:
                kind, may_have = type(error).__name__, error.may_have_taken
                simulator.advance(0.2)
            else:
                kind, may_have = "", True
            simulator.drive(1).refuse_no_more()
            writes = simulator.drive(1).take_writes()
            took = any(address & 0x7FFF == RAM & 0x7FFF and word == value for _, address, word in writes)
            told[kind, may_have, took] += 1
    assert not [each for each in told if each[1:] == (False, True)], sorted(told.items())
    # Each is told apart where it can be, and nothing is told of what nobody knows.
    assert {("", True, True), ("PortError", False, False)} <= set(told), sorted(told.items())
    assert any(each[1:] == (True, False) for each in told), told
    assert any(each[0] and each[1:] == (True, True) for each in told), told


@pytest.mark.parametrize("value", [[], [70000], "x"])
def test_what_cannot_be_was_not_taken(value: object) -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        with pytest.raises(drivebus.BadArgument) as failed:
            bus.write(1, RAM, value)  # type: ignore[arg-type]
        assert not failed.value.may_have_taken
        with pytest.raises(drivebus.Refused) as refused:
            bus.write(1, 0xFFFE, 1)
        assert not refused.value.may_have_taken
        drive = bus.drive(1)
        drive.prepare_control()
        drive.run(10.0)
        with pytest.raises(drivebus.NotReached) as waited:
            drive.wait_for_speed(timeout=0.1)
        assert not waited.value.may_have_taken


def may_have_taken(call: Callable[[], object]) -> bool | None:
    """What the error tells; None without one."""
    try:
        call()
    except DrivebusError as error:
        return error.may_have_taken
    return None


@pytest.mark.parametrize("lost", range(1, 12))
def test_a_start_that_fails_on_the_line(lost: int) -> None:
    """Wherever in the sequence the answers begin to fail: a motor that turns is never said to have taken nothing."""
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        simulator.line.script([(count, "silence") for count in range(lost, 200)])
        told = may_have_taken(lambda: drive.run(10.0))
        simulator.advance(0.5)
        assert told in (None, simulator.drive(1).frequency > 0.0)


@pytest.mark.parametrize("halt", ["stop", "coast"])
@pytest.mark.parametrize("lost", range(1, 12))
def test_a_stop_that_fails_on_the_line(lost: int, halt: str) -> None:
    """The same of what halts, which is sent again and again: one that took it is never said to have taken nothing."""
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        drive.run(10.0)
        drive.wait_for_speed(timeout=30)
        simulator.line.script([(count, "silence") for count in range(lost, 2000)])
        assert may_have_taken(lambda: getattr(drive, halt)(within=0.5)) in (None, simulator.drive(1).frequency < 10.0)
