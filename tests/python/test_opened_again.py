"""A port that was lost and not opened again yet: what is sent next opens it, and reaches whoever is behind it now."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import drivebus
from drivebus import Drive

CONTROL, IDENTIFICATION, ACCELERATION, RAM = 0x2000, 0x2103, 0x000B, 0x8000
STOP = 5


@pytest.fixture
def line(virtual: drivebus.Simulator, virtual_bus: drivebus.Bus, virtual_drive: Drive) -> drivebus.Simulator:
    virtual.drive(1).take_writes()
    virtual.line.unplug()
    with pytest.raises(drivebus.PortError):
        virtual_drive.state()
    virtual.line.replug()
    assert virtual_bus.reconnects == 0
    return virtual


def test_the_same_drive_is_written_to(
    line: drivebus.Simulator, virtual_bus: drivebus.Bus, virtual_drive: Drive
) -> None:
    virtual_drive.write("P00.11", 2.0)
    assert [address for _, address, _ in line.drive(1).writes()] == [RAM | ACCELERATION]
    assert virtual_bus.reconnects == 1


def test_another_drive_is_not(
    line: drivebus.Simulator,
    virtual_bus: drivebus.Bus,
    virtual_drive: Drive,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    read = virtual_bus.read
    other = {IDENTIFICATION: [0x010A]}
    monkeypatch.setattr(virtual_bus, "read", lambda *what, **how: other.get(what[1]) or read(*what, **how))
    with pytest.raises(drivebus.NotAllowed, match="another drive"):
        virtual_drive.write("P00.11", 2.0)
    assert line.drive(1).writes() == []


@pytest.mark.parametrize("exception", [0x06, 0x09, 0x0A])
def test_a_refusal_that_passes_makes_it_no_other_drive(
    line: drivebus.Simulator, virtual_bus: drivebus.Bus, virtual_drive: Drive, exception: int
) -> None:
    """A drive that stays busy, a gateway that does not reach it, a password: nothing is written; it is asked anew."""
    virtual_bus.echo(1)
    assert virtual_bus.reconnects == 1
    line.drive(1).refuse(exception, asked="reads")
    with pytest.raises(
        drivebus.NotAllowed, match=rf"has not identified itself.*refused with exception {exception:02X}H"
    ):
        virtual_drive.write("P00.11", 2.0)
    assert line.drive(1).writes() == []
    line.drive(1).refuse_no_more()
    virtual_drive.write("P00.11", 2.0)
    assert [address for _, address, _ in line.drive(1).writes()] == [RAM | ACCELERATION]


@pytest.mark.parametrize(
    ("family", "code"), [("gd600", "P10.00"), ("gd3000", "P01.21"), ("gd3000-rectifier", "P11.05")]
)
def test_another_drive_gives_itself_away_where_its_family_has_a_code(
    monkeypatch: pytest.MonkeyPatch, family: str, code: str
) -> None:
    """P11.05 of a rectifier is its action on a transmission fault; on a GD350, group 11 protects the motor."""
    with (
        drivebus.Simulator({1: family}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator, timeout=0.25) as bus,
    ):
        drive = bus.drive(1, family)
        drive.write(code, 1, store=True)
        simulator.line.unplug()
        with pytest.raises(drivebus.PortError):
            bus.read(1, 0x0001)
        simulator.line.replug()
        written = simulator.drive(1).writes()
        read, other = bus.read, {IDENTIFICATION: [0x01A0]}
        monkeypatch.setattr(bus, "read", lambda *what, **how: other.get(what[1]) or read(*what, **how))
        with pytest.raises(drivebus.NotAllowed, match="another drive"):
            drive.write(code, 0, store=True)
        assert simulator.drive(1).writes() == written
        other.clear()
        drive.write(code, 0, store=True)


@pytest.mark.parametrize(
    "write",
    [
        pytest.param(lambda drive: drive.write("P00.11", 2.0), id="drive"),
        pytest.param(lambda drive: drive.bus.write(1, RAM | ACCELERATION, 20, read_back=ACCELERATION), id="bus"),
    ],
)
def test_what_another_drive_shows_confirms_nothing(
    virtual: drivebus.Simulator, virtual_drive: Drive, write: Callable[[Drive], None]
) -> None:
    virtual_drive.state()
    # The confirmation is lost, and with the next answer the adapter falls out and is back at once.
    virtual.line.set_times(replug=0.0)
    virtual.line.script([(1, "silence"), (2, "unplug")])
    with pytest.raises(drivebus.NoAnswer) as unknown:
        write(virtual_drive)
    assert unknown.value.started is not None
    assert virtual.drive(1).register(ACCELERATION) == 20
    assert virtual.line.fault_counts()["unplug"] == 1


def test_a_stop_goes_out_at_once(line: drivebus.Simulator, virtual_drive: Drive) -> None:
    virtual_drive.stop()
    assert [value for _, address, value in line.drive(1).writes() if address == CONTROL] == [STOP]
