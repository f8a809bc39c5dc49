"""Every command of every family, given to a simulated drive: what the command register gets is the family's own code.

The codes are those of `tests/vectors/families.toml`. They are looked for in the bytes on the line, so no profile and no
operation of the library can hide another one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivebus import Bus, Drive, NotAllowed, Profile, Simulator

from .test_families import COMMANDS, FAMILIES, given, place_of, words_of

STARTS = {"run_forward", "run_reverse", "jog_forward", "jog_reverse"}

DO: dict[str, Callable[[Drive], None]] = {
    "run_forward": lambda drive: drive.run(),
    "run_reverse": lambda drive: drive.run(reverse=True),
    "jog_forward": lambda drive: drive.jog(),
    "jog_reverse": lambda drive: drive.jog(reverse=True),
    "stop": lambda drive: drive.stop(),
    "coast": lambda drive: drive.coast(),
    "reset_fault": lambda drive: drive.reset_fault(),
    "jog_stop": lambda drive: drive.jog_stop(),
}
BEFORE = {"stop": "run_forward", "coast": "run_forward", "jog_stop": "jog_forward"}
"""What must go on for a command to have something to end."""

EVERY = [(family, command) for family in FAMILIES for command in COMMANDS]
REGISTERS = {place for family, command in EVERY for place, _ in words_of(family, command)} - {None}
KNOWN = [(family, command) for family, command in EVERY if given(family["commands"][command]) is not None]


def each(several: list[tuple[dict[str, Any], str]]) -> pytest.MarkDecorator:
    def name(part: dict[str, Any] | str) -> str:
        return part if isinstance(part, str) else part["name"]

    return pytest.mark.parametrize(("family", "command"), several, ids=name)


@pytest.fixture
def line(family: dict[str, Any]) -> Iterator[tuple[Simulator, Bus]]:
    name = family["name"]
    with Simulator({1: name}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        yield simulator, bus


def drive_of(bus: Bus, family: str, *, unverified: bool) -> Drive:
    """Unit 1; one whose speed has a unit that a parameter decides is told which: no page prints the numbers of that."""
    variants = {"speed_unit": "Hz", "base_frequency": "50 Hz"}
    own = Profile.builtin(family).variants()
    chosen = {name: choice for name, choice in variants.items() if name in own}
    return bus.drive(1, family, unverified=unverified, variants=chosen or None)


def prepare(drive: Drive) -> None:
    """Where no write is known that RAM alone keeps, it is kept in EEPROM."""
    drive.prepare_control(store=drive.profile.memory() is None)
    if drive.profile.name == "smd":
        # It is locked from when its power comes.
        drive.write_words(0x0030, 0)
    if drive.profile.name in {"atv71", "atv320"}:
        # A run waits for the first setpoint.
        drive.setpoint = 10.0
    if drive.profile.state(1) == "running":
        # Its state is its frequency: told to run at 0 Hz it shows nothing.
        drive.prepare_control(setpoint="frequency", store=True)
        drive.setpoint = 10.0


def from_rest(family: dict[str, Any], command: str) -> list[tuple[int | None, int | None]]:
    """Place and word of all that *command* takes from rest: some families want words before a run."""
    table = family["commands"]
    sequence: list[int] = table.get("sequence", []) if command in STARTS else []
    return [*((given(table["register"]), word) for word in sequence), *words_of(family, command)]


def commanded(simulator: Simulator) -> list[tuple[int, int]]:
    """Address and word of all that was written where a family takes commands and the unit itself has no parameter."""
    profile = Profile.builtin(simulator.drive(1).profile)
    rows = (profile.describe(name) for name in profile.names())
    setpoint = profile.role("setpoints.frequency")
    registers = REGISTERS - {row.address for row in rows if row.kind == "parameter"}
    if setpoint is not None:
        registers -= {profile.describe(setpoint).address} - {profile.command_address}
    found = []
    for _, sender, frame in simulator.line.trace():
        if sender == "master" and profile.requests().protocol == "huanyang":
            found += [(0x0300, frame[3])] if frame[1] == 0x03 else []
            continue
        if sender == "master" and frame[1] == 0x05:
            found.append(
                (0x1_0000 + int.from_bytes(frame[2:4], "big"), {0xFF00: 1, 0: 0}[int.from_bytes(frame[4:6], "big")])
            )
        if sender != "master" or frame[1] not in (0x06, 0x10):
            continue
        address = int.from_bytes(frame[2:4], "big")
        data = frame[4:6] if frame[1] == 0x06 else frame[7:-2]
        words = [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data), 2)]
        told = [(address + at, word) for at, word in enumerate(words)]
        found += [(place, word) for place, word in told if {place, place & 0x7FFF} & registers]
    return found


@each(EVERY)
def test_the_code_on_the_line_is_the_familys_own(
    line: tuple[Simulator, Bus], family: dict[str, Any], command: str
) -> None:
    simulator, bus = line
    table = family["commands"]
    register, code = place_of(family, command), given(table[command])
    drive = drive_of(bus, family["name"], unverified=True)
    if register is not None:
        prepare(drive)
    if code is None:
        with pytest.raises(NotAllowed):
            DO[command](drive)
        assert commanded(simulator) == []
        return
    expected: list[tuple[int | None, int | None]] = []
    if command in BEFORE:
        DO[BEFORE[command]](drive)
        expected += from_rest(family, BEFORE[command])
    elif command == "reset_fault":
        simulator.drive(1).trip(1)
    DO[command](drive)
    assert commanded(simulator) == [*expected, *from_rest(family, command)]


@each(KNOWN)
def test_what_no_document_prints_is_not_sent_unasked(
    line: tuple[Simulator, Bus], family: dict[str, Any], command: str
) -> None:
    """A motor is not started either where neither of the ways to stop it may be used."""
    simulator, bus = line
    table = family["commands"]
    doubted = set(table["needs_unverified"])
    prepare(drive_of(bus, family["name"], unverified=True))
    if command == "reset_fault":
        simulator.drive(1).trip(1)
    plain = drive_of(bus, family["name"], unverified=False)
    unproved = bool(table.get("sequence")) and family["states"]["needs_unverified"]
    halts = {"stop", "coast"} & set(plain.profile.commands())
    refused = command in doubted or (command in STARTS and (halts <= doubted or unproved))
    if refused:
        with pytest.raises(NotAllowed, match="unverified=True"):
            DO[command](plain)
        assert commanded(simulator) == []
    else:
        DO[command](plain)
        assert commanded(simulator) == from_rest(family, command)


def test_what_a_vfd500_may_take_for_disable_is_sent_only_if_it_is_forced() -> None:
    """VFD500 manual, p. 135: 0 is "disable command", which may command nothing or disable the drive."""
    with (
        Simulator({1: "vfd500"}, transport="process", clock="virtual") as simulator,
        Bus(simulator) as bus,
    ):
        drive, simulated = bus.drive(1, profile="vfd500"), simulator.drive(1)
        refused = r"0 at 7000H is not a command .* codes are 1 run forward"
        with pytest.raises(NotAllowed, match=refused):
            drive.write_words(0x7000, 0)
        with pytest.raises(NotAllowed, match=refused):
            bus.write(1, 0x7000, 0)
        assert simulated.words_written == 0
        bus.write(1, 0x7000, 0, force=True)
        assert [(address, value) for _, address, value in simulated.writes()] == [(0x7000, 0)]
