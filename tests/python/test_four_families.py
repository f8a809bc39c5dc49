"""One program, four families on one line: each drive is told what its own manual prints, and nothing of the others.

Codes and addresses are typed from the manuals. GD350, chapter 9.4.5; GD600, p. 140 (1 to 8 as GD350); GD3000, p. 214
(1 runs; the rest is taken over from GD350, and used only because the program says so); VFD500, p. 135 (5 coasts, 6
stops, 8 resets, at 7000H), and p. 134 (8000H and the address of a parameter is its EEPROM).
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

import drivebus
import drivebus.aio
from drivebus import Simulator, State

Step = Callable[[Any], Any]


class Family(NamedTuple):
    unit: int
    commands: int
    setpoint: int
    codes: dict[str, int]
    """Run, reset, coast and stop, as the family's manual prints them."""
    sources: list[tuple[int, int]]
    """What has to be written to EEPROM before it obeys the bus: address and value."""
    together: bool
    """Whether command and setpoint travel in one frame (10H)."""
    fault: tuple[int, str]
    certainty: str
    """How sure it is what the unit is, when it is asked: of GD600 and GD3000 no code is printed."""


INVT = {"run": 1, "reset": 7, "coast": 6, "stop": 5}
FAMILIES = {
    "gd350": Family(1, 0x2000, 0x2001, INVT, [(0x0001, 2), (0x0006, 8)], True, (11, "OL1"), "certain"),
    "gd600": Family(2, 0x2000, 0x2001, INVT, [(0x0001, 2), (0x0006, 8)], True, (1, "OUT1"), "unknown"),
    "gd3000": Family(3, 0x2000, 0x2001, INVT, [(0x0001, 2), (0x0006, 8)], False, (77, "Unknown fault 77"), "unknown"),
    "vfd500": Family(
        4,
        0x7000,
        0x7001,
        {"run": 1, "reset": 8, "coast": 5, "stop": 6},
        [(0x8002, 2)],
        True,
        (18, "Earth fault"),
        "by answers",
    ),
}
HZ, WORD = 10.0, 1000  # hundredths of a hertz, in all four; of the VFD500 while P30.14 says Hz


def program(bus: Any, drive: Any, machine: Any, fault: int) -> list[Step]:
    """The same for whoever it is."""
    return [
        lambda _: bus.identify(drive.unit),
        lambda _: drive.prepare_control(store=True),
        lambda _: drive.run(HZ, confirm=5.0),
        lambda _: drive.wait_for_speed(timeout=100),
        lambda _: drive.monitor(),
        lambda _: machine.trip(fault),
        lambda _: drive.fault(),
        lambda _: drive.reset_fault(),
        lambda _: drive.run(HZ, confirm=5.0),
        lambda _: drive.coast(),
        lambda _: machine.wait_for_rest(),
        lambda _: drive.run(HZ, confirm=5.0),
        lambda _: drive.stop(),
        lambda _: drive.wait_until_stopped(timeout=100),
        lambda _: drive.status(),
    ]


class Machine:
    """What happens at the shaft meanwhile."""

    def __init__(self, simulator: Simulator, unit: int) -> None:
        self._simulator, self._drive = simulator, simulator.drive(unit)

    def trip(self, fault: int) -> None:
        self._drive.trip(fault)

    def wait_for_rest(self) -> None:
        self._simulator.advance(100.0)


def line() -> Simulator:
    return Simulator({family.unit: name for name, family in FAMILIES.items()}, transport="process", clock="virtual")


def at_once(name: str, simulator: Simulator) -> list[Any]:
    family = FAMILIES[name]
    with drivebus.Bus(simulator, timeout=0.25) as bus:
        drive = bus.drive(family.unit, name, unverified=True)
        machine = Machine(simulator, family.unit)
        return [step(None) for step in program(bus, drive, machine, family.fault[0])]


def awaited(name: str, simulator: Simulator) -> list[Any]:
    family = FAMILIES[name]

    async def main() -> list[Any]:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(family.unit, name, unverified=True)
            given = []
            for step in program(bus, drive, Machine(simulator, family.unit), family.fault[0]):
                result = step(None)
                given.append(await result if inspect.isawaitable(result) else result)
            return given

    return asyncio.run(main())


@pytest.mark.parametrize("face", [at_once, awaited])
@pytest.mark.parametrize("name", FAMILIES)
def test_the_same_program(name: str, face: Callable[[str, Simulator], list[Any]]) -> None:
    family = FAMILIES[name]
    number, says = family.fault
    with line() as simulator:
        found, control, _, reached, seen, _, fault, *_, stopped, status = face(name, simulator)
        taken = [(address, value) for _, address, value in simulator.drive(family.unit).writes()]
        others = [simulator.drive(each.unit).writes() for each in FAMILIES.values() if each is not family]
        frames = [data for _, who, data in simulator.line.trace() if who == "master"]
    assert found.certainty == family.certainty
    assert name in found.candidates or family.certainty == "unknown"
    assert control
    assert (reached.state, stopped.state, status.fault) == (State.FORWARD, State.STOPPED, None)
    assert reached.frequency == pytest.approx(HZ, abs=0.11)
    assert fault.code == number
    assert says in str(fault)
    assert len(seen) > 1

    commands = [value for address, value in taken if address == family.commands]
    told = ["run", "reset", "run", "coast", "run", "stop"]
    assert commands == [family.codes[command] for command in told]
    assert {address: value for address, value in taken if address not in (family.commands, family.setpoint)} == dict(
        family.sources
    )
    assert [value for address, value in taken if address == family.setpoint] == [WORD] * 3
    assert others == [[], [], []]

    together = bytes([family.unit, 0x10]) + (family.commands).to_bytes(2, "big") + bytes.fromhex("0002 04 0001 03E8")
    setpoint = bytes([family.unit, 0x06]) + (family.setpoint).to_bytes(2, "big") + bytes.fromhex("03E8")
    assert sum(frame.startswith(together) for frame in frames) == (3 if family.together else 0)
    assert sum(frame.startswith(setpoint) for frame in frames) == (0 if family.together else 3)


def test_where_10h_is_not_known_the_setpoint_goes_first() -> None:
    with line() as simulator, drivebus.Bus(simulator) as bus:
        drive = bus.drive(3, "gd3000", unverified=True)
        drive.prepare_control(store=True)
        simulator.drive(3).take_writes()
        drive.run(HZ)
        assert [(address, value) for _, address, value in simulator.drive(3).writes()] == [(0x2001, WORD), (0x2000, 1)]


def test_a_jog_is_ended_as_the_family_ends_it() -> None:
    with line() as simulator, drivebus.Bus(simulator) as bus:
        for name, family in FAMILIES.items():
            drive = bus.drive(family.unit, name, unverified=True)
            drive.prepare_control(store=True)
            with drive.jogging():
                pass
            taken = [value for _, address, value in simulator.drive(family.unit).writes() if address == family.commands]
            assert taken == ([3, 6] if name == "vfd500" else [3, 8]), name
        with pytest.raises(drivebus.NotAllowed, match=r"no command that ends a jog.*stop\(\)"):
            bus.drive(4, "vfd500", unverified=True).jog_stop()


def test_a_jog_of_the_awaitable_face_is_ended_so_too() -> None:
    async def main(simulator: Simulator) -> None:
        async with drivebus.aio.Bus(simulator) as bus:
            for name, family in FAMILIES.items():
                drive = await bus.drive(family.unit, name, unverified=True)
                await drive.prepare_control(store=True)
                simulator.drive(family.unit).take_writes()
                async with drive.jogging():
                    pass

    with line() as simulator:
        asyncio.run(main(simulator))
        taken = {name: [word[2] for word in simulator.drive(each.unit).writes()] for name, each in FAMILIES.items()}
    assert taken == {"gd350": [3, 8], "gd600": [3, 8], "gd3000": [3, 8], "vfd500": [3, 6]}


def test_a_value_goes_to_the_memory_that_the_family_says() -> None:
    """GD350, chapter 9.4.5: 8007H is RAM. VFD500, p. 134: 8007H is kept. GD600: no way to RAM alone is printed."""
    with line() as simulator, drivebus.Bus(simulator) as bus:
        for name, unit, code, store, value, sent in (
            ("gd350", 1, "P00.11", False, 1.5, (0x800B, 15)),
            ("gd350", 1, "P00.11", True, 2.5, (0x000B, 25)),
            ("gd600", 2, "P01.20", True, 1.5, (0x0114, 15)),
            ("gd3000", 3, "P01.20", True, 1.5, (0x0114, 15)),
            ("vfd500", 4, "P00.07", False, 1.5, (0x0007, 150)),
            ("vfd500", 4, "P00.07", True, 2.5, (0x8007, 250)),
        ):
            bus.drive(unit, name, unverified=True).write(code, value, store=store)
            assert [word[1:] for word in simulator.drive(unit).take_writes()] == [sent]
        for unit, name in ((2, "gd600"), (3, "gd3000")):
            with pytest.raises(drivebus.NotAllowed, match=r"RAM alone.*store=True"):
                bus.drive(unit, name, unverified=True).write("P01.20", 2.0)
            assert simulator.drive(unit).writes() == []


def test_no_drive_takes_what_another_family_is_told() -> None:
    """INVT's 5 at 2000H and the VFD500's 6 at 7000H are not for the other one, whichever way they are written."""
    with line() as simulator, drivebus.Bus(simulator) as bus:
        for name, family in FAMILIES.items():
            bus.drive(family.unit, name)
        before = simulator.line.requests
        for unit, address, word in (
            (4, 0x2000, 5),
            (4, 0xA000, 5),
            (1, 0x7000, 6),
            (1, 0x2000, 9),
            (1, 0xA000, 0),
            (4, 0x7000, 9),
            (4, 0xF000, 9),
        ):
            body = address.to_bytes(2, "big")
            for attempt in (
                lambda unit=unit, address=address, word=word: bus.write(unit, address, word),
                lambda unit=unit, address=address, word=word: bus.write(unit, address, [word, 0]),
                lambda unit=unit, body=body, word=word: bus.transact(unit, b"\x06" + body + bytes([0, word])),
                lambda unit=unit, body=body, word=word: bus.transact(unit, b"\x10" + body + bytes([0, 1, 2, 0, word])),
            ):
                with pytest.raises(drivebus.NotAllowed, match="force=True"):
                    attempt()
        with pytest.raises(drivebus.NotAllowed, match="force=True"):
            bus.broadcast(0x2000, 5)  # the VFD500 is on this line too
        with pytest.raises(drivebus.NotAllowed, match="not a command of unit 4"):
            bus.drive(4, "vfd500").write_words(0x7000, 9)
        assert simulator.line.requests == before
        bus.write(1, 0x2000, 5)
        bus.write(4, 0x7000, 7)
        assert [simulator.drive(unit).writes()[-1][1:] for unit in (1, 4)] == [(0x2000, 5), (0x7000, 7)]
        with pytest.raises(drivebus.Refused):
            bus.write(1, 0x2000, 9, force=True)


def test_what_is_not_known_to_the_bus_is_not_judged() -> None:
    with line() as simulator, drivebus.Bus(simulator) as bus:
        with pytest.raises(drivebus.Refused):
            bus.write(1, 0x2000, 9)
        assert simulator.drive(1).writes() == []
