"""One behaviour, two faces: what the awaited drive puts on the wire is what the synchronous one puts there.

Each step is run on a line of its own in virtual time, once at once and once awaited. What it gives, what it raises and
every byte on the wire must be the same; only the words of echoes are made up afresh.
"""

from __future__ import annotations

import asyncio
import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Simulator

Step = Callable[[Any, Any], Any]


def _prepared(step: Step) -> list[Step]:
    return [lambda _, drive: drive.prepare_control(), step]


def _running(*then: Step) -> list[Step]:
    return [
        lambda _, drive: drive.prepare_control(),
        lambda _, drive: drive.write({"P00.11": 1.0, "P00.12": 1.0}),
        lambda _, drive: drive.run(10.0),
        *then,
    ]


def _line() -> Simulator:
    return Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual")


@functools.cache
def _backup() -> drivebus.Backup:
    """What a drive from the factory has."""
    with _line() as simulator, drivebus.Bus(simulator) as bus:
        return bus.drive(1).backup()


STEPS: dict[str, list[Step]] = {
    "read": [lambda bus, _: bus.read(1, 0x2100), lambda bus, _: bus.read(2, 0x3000, 10, verify=True)],
    "urgent": [lambda bus, _: bus.read(1, 0x2100, urgent=True)],
    "write": [lambda bus, _: bus.write(1, 0x800B, 20), lambda bus, _: bus.write(1, 0x2001, [1000])],
    "read back": [lambda bus, _: bus.write(1, 0x2001, 500, read_back=0x2001)],
    "broadcast": [lambda bus, _: bus.broadcast(0x2001, 500)],
    "echo": [lambda bus, _: bus.echo(1, 0x1234)],
    "transact": [lambda bus, _: bus.transact(1, b"\x03\x21\x00\x00\x01")],
    "link": [lambda bus, _: bus.link(1)],
    "sleep": [lambda bus, _: bus.sleep(0.2), lambda bus, _: bus.now()],
    "listen": [lambda bus, _: bus.listen(0.2)],
    "no unit": [lambda bus, _: bus.read(9, 0x2100)],
    "refused": [lambda bus, _: bus.read(1, 0x7000)],
    "no such address": [lambda bus, _: bus.read(1, -1)],
    "no such unit": [lambda bus, _: bus.write(248, 0, 0)],
    "who is it": [lambda bus, _: bus.drive(2)],
    "which profile": [lambda bus, _: bus.drive(2, "gd350")],
    "no drive": [lambda bus, _: bus.drive(9)],
    "status": [lambda _, drive: drive.status(), lambda _, drive: drive.state(), lambda _, drive: drive.fault()],
    "history": [lambda _, drive: drive.fault_history()],
    "monitor": [lambda _, drive: drive.monitor(), lambda _, drive: drive.monitor("output_current")],
    "values": [lambda _, drive: drive.read("P00.11"), lambda _, drive: drive.read("P00.11", "P00.12", verify=True)],
    "no value": [lambda _, drive: drive.read()],
    "unknown": [lambda _, drive: drive.read("P99.99")],
    "setpoint": [lambda _, drive: drive.write("set_frequency", 7.0), lambda _, drive: drive.read_setpoint()],
    "checked setpoints": [
        lambda _, drive: drive.check_setpoints(5.0, 30.0),
        lambda _, drive: drive.check_setpoints(5.0, 500.0),
        lambda _, drive: drive.settled_profile("set_frequency"),
    ],
    "prepare": [lambda _, drive: drive.check_control(), *_prepared(lambda _, drive: drive.check_control())],
    "parameters": _prepared(lambda _, drive: drive.write({"P00.11": 2.0, "P00.12": 3.0})),
    "stored": _prepared(lambda _, drive: drive.write("P00.11", 2.0, store=True)),
    "too much": _prepared(lambda _, drive: drive.write("P00.11", 2e9)),
    "not prepared": [lambda _, drive: drive.run(10.0)],
    "run": _running(lambda _, drive: drive.wait_for_speed(timeout=30)),
    "stop": _running(lambda _, drive: drive.stop(), lambda _, drive: drive.wait_until_stopped(timeout=30)),
    "coast": _running(lambda _, drive: drive.coast()),
    "turn round": _running(lambda _, drive: drive.run(10.0, reverse=True)),
    "jog": [*_prepared(lambda _, drive: drive.jog(confirm=2.0)), lambda _, drive: drive.jog_stop()],
    "backup": [lambda _, drive: drive.backup(), lambda _, drive: drive.diff()],
    "restore": [lambda _, drive: drive.write("P00.11", 3.0, store=True), lambda _, drive: drive.restore(_backup())],
    "dry run": [lambda _, drive: drive.restore(_backup(), dry_run=True), lambda _, drive: drive.diff(_backup())],
    "no fault": _prepared(lambda _, drive: drive.reset_fault()),
    "never reached": _running(lambda _, drive: drive.wait_for_speed(40.0, timeout=1.0)),
    "too fast": _prepared(lambda _, drive: drive.run(500.0)),
}


class Spoilt:
    """What is done to the line before the steps."""

    def __init__(self, name: str, spoil: Callable[[Simulator], None]) -> None:
        self.name, self.spoil = name, spoil


SPOILT = [
    Spoilt("good line", lambda _: None),
    Spoilt("two answers lost", lambda simulator: simulator.line.drop_answers(2)),
    Spoilt("all answers lost", lambda simulator: simulator.line.drop_answers(10_000)),
    Spoilt("a fault", lambda simulator: simulator.drive(1).trip("OL1")),
]


def _shown(value: object) -> object:
    """What can be compared; times of virtual lines begin when they were opened."""
    if isinstance(value, (drivebus.Status, drivebus.Diff, drivebus.Restoration)):
        return str(value)
    if isinstance(value, drivebus.Snapshot):
        return dict(value)
    return repr(value) if isinstance(value, (drivebus.Control, drivebus.Fault)) or "Drive" in repr(value) else value


def _failed(error: drivebus.DrivebusError) -> object:
    return type(error).__name__, str(error), error.unit


def _wire(simulator: Simulator) -> list[tuple[float, str, bytes]]:
    return [
        (time, who, data if data[1:2] != b"\x08" or data[4:6] == b"\x12\x34" else data[:4])
        for time, who, data in simulator.line.trace()
    ]


def at_once(steps: list[Step], spoil: Callable[[Simulator], None]) -> tuple[list[object], object]:
    seen: list[object] = []
    with _line() as simulator, drivebus.Bus(simulator, timeout=0.25) as bus:
        drive = bus.drive(1)
        spoil(simulator)
        for step in steps:
            try:
                seen.append(_shown(step(bus, drive)))
            except drivebus.DrivebusError as error:
                seen.append(_failed(error))
        return seen, _wire(simulator)


async def awaited(steps: list[Step], spoil: Callable[[Simulator], None]) -> tuple[list[object], object]:
    seen: list[object] = []
    with _line() as simulator:
        async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
            drive = await bus.drive(1)
            spoil(simulator)
            for step in steps:
                try:
                    result = step(bus, drive)
                    seen.append(_shown(await result if inspect.isawaitable(result) else result))
                except drivebus.DrivebusError as error:
                    seen.append(_failed(error))
        return seen, _wire(simulator)


@pytest.mark.parametrize("spoilt", SPOILT, ids=lambda spoilt: spoilt.name)
@pytest.mark.parametrize("name", STEPS)
def test_both_faces_do_the_same(name: str, spoilt: Spoilt) -> None:
    seen, wire = at_once(STEPS[name], spoilt.spoil)
    assert asyncio.run(awaited(STEPS[name], spoilt.spoil)) == (seen, wire)


def test_a_scan_finds_the_same() -> None:
    async def scan() -> tuple[list[drivebus.Found], object]:
        with _line() as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                return [found async for found in bus.scan(range(1, 5))], _wire(simulator)

    with _line() as simulator, drivebus.Bus(simulator) as bus:
        expected = list(bus.scan(range(1, 5))), _wire(simulator)
    assert asyncio.run(scan()) == expected
    assert [found.unit for found in expected[0]] == [1, 2]


def test_every_name_of_the_synchronous_faces_is_there() -> None:
    """And a method's arguments are the same."""
    faces = (
        (drivebus.Bus, drivebus.aio.Bus),
        (drivebus.Drive, drivebus.aio.Drive),
        (drivebus.Motor, drivebus.aio.Motor),
    )
    for face, other in faces:
        for name in dir(face):
            if name.startswith("_") or name in ("around", "poll"):
                continue
            ours, theirs = getattr(face, name), getattr(other, name)
            if callable(ours):
                expected = [(each.name, each.default) for each in inspect.signature(ours).parameters.values()]
                given = [(each.name, each.default) for each in inspect.signature(theirs).parameters.values()]
                assert given == expected, name


def test_what_blocks_says_so_to_a_drive_of_asyncio(tmp_path: Path) -> None:
    takers: list[Callable[[Any], object]] = [
        lambda drive: drivebus.Recorder(tmp_path / "run.csv", {drive: None}),
        lambda drive: drivebus.trial.step(drive, 10.0, 20.0, duration=5.0, max_current=None),
        lambda drive: drivebus.trial.ramp(drive, 10.0, 20.0, duration=5.0, max_current=None),
        lambda drive: drivebus.trial.sine(drive, 10.0, 20.0, period=2.0, duration=10.0, max_current=None),
    ]

    async def asked() -> None:
        async with drivebus.aio.Bus(_line()) as bus:
            drive = await bus.drive(1, "gd350", trust_profile=True)
            before = bus.stats()["requests"]
            for taker in takers:
                with pytest.raises(drivebus.NotAllowed, match=r"one of asyncio: open the line with drivebus\.Bus"):
                    taker(drive)
                with pytest.raises(drivebus.NotAllowed, match=r"and was given 7|drives is \{7"):
                    taker(7)
            assert bus.stats()["requests"] == before

    asyncio.run(asked())
    assert not list(tmp_path.iterdir())
