"""Faults by number, by what the keypad shows, and with what the drive saw when it tripped.

GD350: 35 is STo, maladjustment, and 40 is STO, safe torque off. A drive that keeps values is made up here: no shipped
profile knows of any.
"""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, Simulator

PROFILE = Path(__file__).parents[2] / "crates/drives/profiles/gd350"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A GD350 whose P00.11 and P14.03 hold what it saw."""
    folder = tmp_path / "keeping"
    shutil.copytree(PROFILE, folder)
    manifest = folder / "profile.toml"
    text = manifest.read_text("utf-8")
    assert "[faults]\n" in text
    manifest.write_text(text.replace("[faults]\n", '[faults]\nvalues = ["P00.11", "P14.03"]\n'), "utf-8")
    return folder


def test_the_latest_fault_has_its_values(virtual: Simulator, virtual_bus: Bus, folder: Path) -> None:
    drive = virtual_bus.drive(1, folder)
    assert drive.fault_history() == []
    virtual.drive(1).trip("OL1")
    virtual.drive(1).trip("EF")
    latest, before = drive.fault_history()
    assert [fault.mnemonic for fault in (latest, before)] == ["EF", "OL1"]
    assert dict(latest.values) == drive.read("P00.11", "P14.03")
    assert isinstance(latest.values, drivebus.Snapshot)
    assert latest.values.units == {"P00.11": "s", "P14.03": "ms"}
    assert before.values == {}


def test_the_awaitable_face_tells_them_too(virtual: Simulator, folder: Path) -> None:
    async def main() -> list[drivebus.Fault]:
        async with drivebus.aio.Bus(virtual) as bus:
            return await (await bus.drive(1, folder)).fault_history()

    virtual.drive(1).trip("OL1")
    [fault] = asyncio.run(main())
    assert set(fault.values) == {"P00.11", "P14.03"}


@pytest.mark.parametrize(
    ("number", "mnemonic", "label"),
    [(35, "STo", "adjust"), (40, "STO", "torque off")],
)
def test_sto_and_sto_are_told_apart(
    virtual: Simulator, virtual_drive: Drive, number: int, mnemonic: str, label: str
) -> None:
    virtual.drive(1).trip(mnemonic)
    fault = virtual_drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (number, mnemonic)
    assert label in fault.label.lower()


def test_a_number_that_nobody_knows_is_shown_as_that(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual.drive(1).trip(999)
    fault = virtual_drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic, fault.verified) == (999, "", False)
    assert "Unknown fault 999" in str(fault)
