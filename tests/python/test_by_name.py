"""What stores, forces or reverses is given by its name. By its place it works until 1.0, and says how it is written."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import drivebus.aio
from drivebus import Bus, Simulator

CONTROL, STOP, JOG_STOP = 0x2000, 5, 8
P00_11_IN_RAM, P00_11_IN_EEPROM = 0x800B, 0x000B

CALLS: dict[str, tuple[Callable[[Any], Any], str, tuple[int, int]]] = {
    "run": (lambda drive: drive.run(None, True), r"run\(…, reverse=True\)", (CONTROL, 2)),
    "jog": (lambda drive: drive.jog(True), r"jog\(…, reverse=True\)", (CONTROL, 4)),
    "write": (lambda drive: drive.write("P00.11", 5.0, True), r"write\(…, store=True\)", (P00_11_IN_EEPROM, 50)),
    "write_words": (
        lambda drive: drive.write_words(P00_11_IN_RAM, 60, True),
        r"write_words\(…, force=True\)",
        (P00_11_IN_RAM, 60),
    ),
    "prepare_control": (lambda drive: drive.prepare_control(True), r"prepare_control\(…, store=True\)", (0x0001, 2)),
}


@pytest.mark.parametrize("name", CALLS)
def test_by_its_place_it_is_taken_and_the_name_is_said(name: str, virtual: Simulator, virtual_bus: Bus) -> None:
    call, said, written = CALLS[name]
    drive = virtual_bus.drive(1)
    if name in ("run", "jog"):
        drive.prepare_control()
    virtual.drive(1).take_writes()
    with pytest.warns(DeprecationWarning, match=f"{said}.*by its name, from drivebus 1.0 on only so") as warned:
        call(drive)
    assert warned[0].filename == __file__
    assert written in [(address, value) for _, address, value in virtual.drive(1).writes()]


@pytest.mark.parametrize("name", ["running", "jogging"])
def test_a_block_too(name: str, virtual: Simulator, virtual_drive: Any) -> None:
    given = (5.0, True) if name == "running" else (True,)
    with pytest.warns(DeprecationWarning, match=rf"{name}\(…, reverse=True\)"), getattr(virtual_drive, name)(*given):
        pass
    commands = [value for _, address, value in virtual.drive(1).writes() if address == CONTROL]
    assert commands in ([2, STOP], [4, JOG_STOP])


def test_in_asyncio_too() -> None:
    async def main() -> None:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive: Any = await bus.drive(1)
                with pytest.warns(DeprecationWarning, match="store=True") as warned:
                    await drive.write("P00.11", 5.0, True)
                assert warned[0].filename == __file__
                assert simulator.drive(1).writes()[-1][1] == P00_11_IN_EEPROM
                await drive.write("P00.11", 5.0, store=False)
                assert simulator.drive(1).writes()[-1][1] == P00_11_IN_RAM

    asyncio.run(main())


def test_more_than_that_is_a_mistake_and_sends_nothing(virtual: Simulator, virtual_drive: Any) -> None:
    virtual.drive(1).take_writes()
    calls: list[tuple[str, tuple[object, ...], dict[str, object]]] = [
        ("run", (5.0, True, 1.0), {}),
        ("run", (5.0, True), {"reverse": True}),
        ("write", ("P00.11", 5.0, True, True), {}),
        ("prepare_control", (True, "torque"), {}),
    ]
    for name, given, named in calls:
        with pytest.raises(TypeError, match="positional argument"):
            getattr(virtual_drive, name)(*given, **named)
    assert virtual.drive(1).writes() == []
