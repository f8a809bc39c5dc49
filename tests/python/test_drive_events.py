"""What happens to a drive goes to `logging`: each change once, in the order in which it was seen."""

from __future__ import annotations

import contextlib
import logging

import pytest

import drivebus
from drivebus import Simulator


def test_each_change_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, drivebus.Bus(simulator) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        caplog.set_level(logging.INFO, logger="drivebus.drive")
        drive.run(10.0)
        drive.status()
        drive.status()
        simulator.drive(1).trip("OL1")
        drive.status()
        drive.status()
        drive.reset_fault()
        simulator.line.drop_answers(8)
        for _ in range(2):
            with contextlib.suppress(drivebus.NoAnswer):
                drive.status()
        drive.status()
        drive.stop()
    said = [(record.levelname, record.getMessage()) for record in caplog.records]
    assert [(level, text.split(",")[0].partition(":")[2].strip().partition(":")[0]) for level, text in said] == [
        ("INFO", "took run forward"),
        ("INFO", "stopped"),
        ("WARNING", "in fault"),
        ("INFO", "took fault reset"),
        ("INFO", "out of fault"),
        ("WARNING", "lost"),
        ("INFO", "answers again"),
        ("INFO", "took stop"),
    ]
    assert all(text.startswith("unit 1: ") for _, text in said)
    assert {record.__dict__["unit"] for record in caplog.records} == {1}
