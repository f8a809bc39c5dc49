"""What an operation of the core wishes for, and what comes of it, as records of the logger `drivebus.operations`."""

from __future__ import annotations

import logging

import pytest

import drivebus
from drivebus.line.tasks import LOGGER


def test_each_wish_of_a_call_is_told_with_what_came_of_it(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, LOGGER)
    with drivebus.Bus("sim://1=gd350?clock=virtual", timeout=0.1) as bus:
        bus.identify(1)
        with pytest.raises(drivebus.NoAnswer):
            bus.identify(9)
    told = [record.message for record in caplog.records if record.name == LOGGER]
    # INVT's code of a GD350, and its state word.
    assert told[:2] == ["read 2103H of unit 1 -> [416]", "read 2100H of unit 1 -> [3]"]
    assert told[-1].startswith("read 2103H of unit 9 -> NoAnswer: unit 9, read 2103H: no answer"), told[-1]


def test_what_is_asked_otherwise_than_the_bus_asks_is_told(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, LOGGER)
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        bus.drive(1, "gd350").stop()
    told = [record.message for record in caplog.records if record.name == LOGGER]
    assert told[0] == "read 2103H of unit 1, urgent, within 0.1 s, repeated 0 times at most -> [416]"
    # INVT's command register, and its word for a stop by the ramp.
    assert "write 0005H to 2000H of unit 1, urgent, within 0.1 s -> done" in told


def test_who_does_not_ask_for_them_gets_none(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, LOGGER)
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        bus.identify(1)
    assert not [record for record in caplog.records if record.name == LOGGER]
