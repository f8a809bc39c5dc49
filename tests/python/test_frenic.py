"""Fuji FRENIC: what its manuals print, and what is told from it before a write.

M14, S05 and M09: FRENIC-Ace manual (easymanua.ls fuji-electric frenic-ace-series), p. 563. The rule of addresses and
the zeros: FRENIC-HVAC/AQUA RS-485 manual 24A7-E-0021 (manualslib 1367373), pp. 45 and 46.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest

import drivebus
from drivebus import Bus, NotAllowed, Simulator


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "frenic"}, transport="process", clock="virtual") as simulator:
        yield simulator


def test_nothing_moves_by_what_is_printed_alone(line: Simulator) -> None:
    with Bus(line) as bus, pytest.raises(NotAllowed):
        bus.drive(1, "frenic").run(20.0)
    assert line.drive(1).writes() == []


def test_its_state_is_told_by_what_is_printed_alone(line: Simulator) -> None:
    with Bus(line) as bus:
        status = bus.drive(1, "frenic").status()
        assert (status.state, status.frequency) == ("stopped", 0.0)


def test_an_unused_code_reads_as_zero(line: Simulator) -> None:
    """F40, and X01, where others say what the motor does."""
    with Bus(line) as bus:
        assert [bus.read(1, address)[0] for address in (0x0028, 0x1001)] == [0, 0]


def test_its_zeros_make_it_no_other_family(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty, list(found.candidates)) == ("frenic", "by answers", ["frenic"])


@pytest.mark.parametrize("named", [name for name in drivebus.profiles() if name != "frenic"])
def test_no_other_name_moves_it_or_sets_a_code_of_it(line: Simulator, named: str) -> None:
    machine = line.drive(1)
    with Bus(line) as bus:
        drive = bus.drive(1, named, unverified=True)
        for halt in ("stop", "coast", "reset_fault"):
            with suppress(drivebus.DrivebusError):
                getattr(drive, halt)()
        with suppress(drivebus.DrivebusError):
            drive.run(20.0)
    assert (machine.eeprom_writes, machine.frequency) == (0, 0.0)


@pytest.mark.parametrize("unit", [name for name in drivebus.profiles() if name != "frenic"])
def test_as_this_one_no_other_is_moved_or_set(unit: str) -> None:
    """0706H is P07.06 of an INVT drive, and 0705H P07.05."""
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "frenic", unverified=True)
        for halt in ("stop", "coast", "reset_fault"):
            with suppress(drivebus.DrivebusError):
                getattr(drive, halt)()
        with suppress(drivebus.DrivebusError):
            drive.run(20.0)
        assert (line.drive(1).eeprom_writes, line.drive(1).frequency) == (0, 0.0)
