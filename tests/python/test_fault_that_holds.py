"""A drive whose register keeps the number of its last fault: it is the present fault while the state says so."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.python.test_broken_profiles import change

from drivebus import Bus, Drive, Simulator, State

EX9 = Path(__file__).resolve().parents[1] / "vectors/profiles/ex9"
FAULT_CODE = 0x2101
OVERCURRENT = 1
"""OC, in its faults.csv."""


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Simulator]:
    folder = tmp_path / "ex9"
    shutil.copytree(EX9, folder)
    change(folder / "profile.toml", "fault_holds = false", "fault_holds = true")
    with Simulator({1: folder}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator, tmp_path: Path) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, profile=tmp_path / "ex9", unverified=True)
        drive.prepare_control()
        yield drive


def test_what_is_past_is_no_fault(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(OVERCURRENT)
    status = drive.status()
    assert status.state is State.FAULT
    assert status.fault is not None
    assert (status.fault.code, drive.fault()) == (OVERCURRENT, status.fault)
    drive.reset_fault()
    assert line.drive(1).register(FAULT_CODE) == OVERCURRENT, "it is kept"
    status = drive.status()
    assert (status.state, status.fault, drive.fault()) == (State.STOPPED, None, None)
    assert drive.look().fault is None


def test_a_motor_is_started_though_the_number_is_there(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(OVERCURRENT)
    drive.reset_fault()
    drive.run(10.0)
    assert drive.wait_for_speed(10.0, timeout=60).fault is None
    line.drive(1).power_cycle()
    assert drive.status().fault is None
