"""The kinds of `NotAllowed`, which a program can tell apart: each by what brings it about."""

from __future__ import annotations

import contextlib
import copy
import pickle
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import get_args

import pytest

import drivebus
from drivebus import (
    BadArgument,
    BadLink,
    Bus,
    Drive,
    NotAllowed,
    NotReady,
    QueueFull,
    Simulator,
    Unverified,
    WrongDrive,
)
from drivebus.errors import Why

ROOT = Path(__file__).resolve().parents[2]
KINDS = (BadArgument, BadLink, NotReady, QueueFull, Unverified, WrongDrive)


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, timeout=0.25) as bus:
        yield bus


@pytest.fixture
def drive(bus: Bus, simulator: Simulator) -> Drive:
    drive = bus.drive(1)
    drive.prepare_control()
    simulator.drive(1).take_writes()
    return drive


def refused(kind: type[NotAllowed], call: Callable[[], object]) -> NotAllowed:
    """The error of *call*, which is of that very kind."""
    with pytest.raises(NotAllowed) as refused:
        call()
    assert type(refused.value) is kind, repr(refused.value)
    return refused.value


def test_each_is_a_not_allowed_and_a_value_error() -> None:
    for kind in KINDS:
        assert issubclass(kind, NotAllowed)
        assert issubclass(kind, ValueError)


@pytest.mark.parametrize(
    "call",
    [
        lambda drive: drive.read("output_curent"),
        lambda drive: drive.write("P00.11", -1),
        lambda drive: drive.run(500.0),
        lambda drive: drive.write_setpoint(5.0, "speed"),
        lambda drive: drive.bus.read(0, 1),
        lambda drive: drive.bus.read(1, 0, 126),
        lambda drive: drive.bus.write(1, 0x3000, 0x10000),
        lambda drive: drive.bus.drive(1, "gd360"),
        lambda drive: drive.bus.poll({}),
        lambda drive: drive.restore("no such file"),
        lambda _: Bus("sim://gd350", baudrate=1),
        lambda _: Bus("sim://gd350", parity="X"),
    ],
)
def test_what_was_given_cannot_be(drive: Drive, simulator: Simulator, call: Callable[[Drive], object]) -> None:
    refused(BadArgument, lambda: call(drive))
    assert simulator.drive(1).take_writes() == []


def why(call: Callable[[], object]) -> str:
    error = refused(NotReady, call)
    assert isinstance(error, NotReady)
    return error.why


class TestNotReady:
    def test_in_fault(self, drive: Drive, simulator: Simulator) -> None:
        simulator.drive(1).trip("OL1")
        assert why(lambda: drive.run(10.0)) == "fault"

    def test_turning(self, drive: Drive) -> None:
        drive.run(10.0)
        assert why(drive.jog) == "turning"
        assert why(lambda: drive.write("P00.03", 60.0)) == "turning"

    def test_commands_come_from_elsewhere(self, bus: Bus) -> None:
        assert why(lambda: bus.drive(1).run(10.0)) == "control_source"

    def test_a_parameter_must_be_set(self, drive: Drive) -> None:
        drive.write("P00.06", 0, unverified=True)
        assert why(lambda: drive.run(10.0)) == "settings"
        assert why(lambda: drive.write_setpoint(50.0, "pid")) == "settings"

    def test_the_bus_is_for_reading_only(self, simulator: Simulator) -> None:
        with Bus(simulator, read_only=True) as bus:
            assert why(lambda: bus.write(1, 0x3000, 1)) == "read_only"
            assert why(lambda: bus.transact(1, b"\x03\x01\x01")) == "read_only"
            assert why(bus.drive(1).stop) == "read_only"


def test_no_document_proves_it(bus: Bus) -> None:
    drive = bus.drive(2, "vfd500")
    assert "unverified=True" in str(refused(Unverified, lambda: drive.set_virtual_outputs(RL1=True)))
    refused(Unverified, lambda: bus.drive(1).write("P14.03", 10))


def test_another_drive_hangs_there(bus: Bus, simulator: Simulator, tmp_path: Path) -> None:
    refused(WrongDrive, lambda: bus.drive(1, "gd300", unverified=True).write("P00.11", 5.0))
    kept = bus.drive(1, "gd350").backup(tmp_path / "pump.backup.toml")
    refused(WrongDrive, lambda: bus.drive(2, "vfd500").restore(kept))
    assert simulator.drive(1).take_writes() == simulator.drive(2).take_writes() == []


def test_a_motor_is_not_started_over_a_bad_link(drive: Drive, simulator: Simulator) -> None:
    simulator.line.set_faults(silence=0.5)
    for _ in range(5):
        with contextlib.suppress(drivebus.DrivebusError):
            drive.status()
    refused(BadLink, lambda: drive.run(10.0))
    assert simulator.drive(1).take_writes() == []


@pytest.mark.parametrize("kind", KINDS)
def test_they_can_be_copied_and_sent_to_another_process(kind: type[NotAllowed]) -> None:
    error = kind("no", unit=3, request=b"\x01")
    if isinstance(error, NotReady):
        error.why = "fault"
    for same in (copy.copy(error), pickle.loads(pickle.dumps(error))):
        assert (type(same), str(same), vars(same)) == (kind, "no", vars(error))


def test_the_reasons_of_not_ready_stand_alike_in_its_type_its_docstring_and_the_page() -> None:
    reasons = {word for word in get_args(Why) if word}
    page = (ROOT / "docs/reference/python.md").read_text(encoding="utf-8")
    [row] = [line for line in page.splitlines() if line.startswith("| `NotReady` |")]
    for text in (row, drivebus.NotReady.__doc__ or ""):
        assert set(re.findall(r'"([a-z_]+)"', text)) == reasons
