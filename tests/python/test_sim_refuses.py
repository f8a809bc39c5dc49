"""A simulated drive that was told to refuse does so, for as long as it was told to, and nothing else changes."""

from __future__ import annotations

import pytest

import drivebus
from drivebus import Bus, Simulator

STATE, ACCELERATION = 0x2100, 0x000B


def refused(bus: Bus, *, write: bool = False) -> int | None:
    """The exception that a read or write gets; None where the drive does it."""
    pdu = bytes.fromhex("06 000B 0032" if write else "03 2100 0001")
    try:
        bus.transact(1, pdu)
    except drivebus.Refused as error:
        return error.code
    return None


def test_it_refuses_what_it_was_told_to_for_so_long(virtual: Simulator, virtual_bus: Bus) -> None:
    drive = virtual.drive(1)
    drive.refuse(0x0A, asked="writes", seconds=2.0)
    assert (refused(virtual_bus), refused(virtual_bus, write=True)) == (None, 0x0A)
    virtual.advance(2.0)
    assert refused(virtual_bus, write=True) is None
    drive.refuse(count=2)
    assert [refused(virtual_bus) for _ in range(3)] == [0x06, 0x06, None]
    drive.refuse(asked="reads")
    assert (refused(virtual_bus), refused(virtual_bus, write=True)) == (0x06, None)
    drive.refuse_no_more()
    assert refused(virtual_bus) is None


def test_it_may_do_what_it_answers_by_an_exception(virtual: Simulator, virtual_bus: Bus) -> None:
    drive = virtual.drive(1)
    assert drive.register(ACCELERATION) != 0x32
    drive.refuse(0x05, taken=True)
    assert refused(virtual_bus, write=True) == 0x05
    assert drive.register(ACCELERATION) == 0x32


@pytest.mark.parametrize("wrong", [{"code": 0}, {"share": 1.5}, {"asked": "all"}, {"seconds": -1.0}, {"count": 1.5}])
def test_what_cannot_be_told_is_not_allowed(virtual: Simulator, virtual_bus: Bus, wrong: dict[str, object]) -> None:
    with pytest.raises(drivebus.NotAllowed):
        virtual.drive(1).refuse(**wrong)  # type: ignore[arg-type]
    assert refused(virtual_bus) is None
