"""Every family: backup, back to the factory, restore, and nothing differs."""

from __future__ import annotations

import random
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, NotAllowed, Refused, Simulator

from .kept import once, times_stored

DiesAt = Callable[[int, bool], AbstractContextManager[None]]


def parameters(family: str) -> list[str]:
    profile = drivebus.Profile.builtin(family)
    return [name for name in profile.names() if profile.describe(name).kind == "parameter"]


def can_be_set(family: str) -> bool:
    """Not so of an A1000: what is written to it takes an Enter command, which nobody gives here."""
    profile = drivebus.Profile.builtin(family)
    # Two words are read, and written by their name alone.
    rows = map(profile.describe, parameters(family))
    return any(row.writable and row.words == 1 for row in rows)


WITH = [family for family in drivebus.profiles() if can_be_set(family)]
UNPROVED = {"acs355", "atv320", "j1000"}
"""Of these no page prints by which word they store, or what they have: nothing is given back without `unverified`."""
WITHOUT = [family for family in drivebus.profiles() if not parameters(family)]


def unsettle(drive: Drive) -> dict[str, int]:
    """Stores another value in all that a restore gives back, where the drive takes one; the words by code."""
    profile = drive.profile
    functions = profile.functions
    chance = random.Random(profile.name)
    # Of the settings of the line, the delay changes nothing that would end this.
    line = {code for code in profile.serial_parameters() if profile.describe(code).name != "response_delay"}
    memory = profile.memory()
    stores = set() if memory is None else {memory.store_register}
    left = {*line, *stores, *profile.acts(), *profile.fault_history, *profile.fault_values}
    changed: dict[str, int] = {}
    for name in parameters(profile.name):
        known = profile.describe(name)
        code = known.code or name
        if code in left or known.access == "ro" or known.words > 1 or known.address is None:
            continue
        if known.evidence == "assumed" and not drive.unverified:
            continue
        try:
            [now] = drive.read_words(known.address)
        except Refused:
            continue
        for word in (now + 1, now - 1, now + chance.randint(2, 50)):
            try:
                profile.encode(name, profile.decode(name, word))
                # A J1000 knows no 06H.
                drive.bus.write(
                    drive.unit,
                    profile.address(name, store=True),
                    [word] if 0x10 in functions and 0x06 not in functions else word,
                )
            except (NotAllowed, Refused):
                continue
            changed[code] = word
            break
    return changed


@pytest.mark.parametrize(
    ("family", "unverified"),
    [(family, trusts) for family in WITH for trusts in (False, True) if trusts or family not in UNPROVED],
)
def test_there_and_back_again(family: str, unverified: bool, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1, family, unverified=unverified)
        changed = unsettle(drive)
        assert changed
        kept = drive.backup(path)
        assert {code: kept.raw[code] for code in changed} == changed
        machine = simulator.drive(1)
        machine.factory_reset()
        assert {each.code for each in drive.diff(path)} == {*changed}
        machine.take_writes()

        report = drive.restore(path, motor=True, serial=True)
        assert (report.ok, {item.code for item in report.having("restored")}) == (True, {*changed})
        assert times_stored(simulator, drive) == once(drive, changed)
        machine.power_cycle()
        assert not drive.diff(path)


@pytest.mark.parametrize("family", WITH)
def test_cut_off_at_any_moment_no_memory_is_written_twice(family: str, dies_at: DiesAt) -> None:
    chance = random.Random(family)
    for _ in range(10):
        with Simulator({1: family}, transport="process", clock="virtual") as simulator:
            machine = simulator.drive(1)
            trusts = family in UNPROVED
            with Bus(simulator) as bus:
                drive = bus.drive(1, family, unverified=trusts)
                changed = unsettle(drive)
                kept = drive.backup()
                machine.factory_reset()
            machine.take_writes()
            before = machine.eeprom_writes
            for _ in range(3):
                with dies_at(chance.randint(1, 4 * len(changed) + 20), chance.random() < 0.5), Bus(simulator) as bus:
                    bus.drive(1, family, unverified=trusts).restore(kept, serial=True, motor=True)
            with Bus(simulator) as bus:
                drive = bus.drive(1, family, unverified=trusts)
                assert drive.restore(kept, serial=True, motor=True).ok
                assert not drive.diff(kept)
            assert times_stored(simulator, drive) == once(drive, changed)
            assert machine.eeprom_writes - before == len(changed)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("family", ["gd350", "gd600", "vfd500"])
def test_over_a_bad_line_no_memory_is_written_twice(family: str, seed: int) -> None:
    """One answer in ten is lost, late, damaged or not the drive's; the restore is said again until it is done."""
    with Simulator({1: family}, transport="process", clock="virtual", seed=seed) as simulator:
        machine = simulator.drive(1)
        with Bus(simulator) as bus:
            changed = unsettle(bus.drive(1, family))
            kept = bus.drive(1, family).backup()
        machine.factory_reset()
        machine.take_writes()
        # What was asked on a bus that is closed by now is assumed to be answered in order
        # (docs/developers/architecture.md).
        simulator.line.set_faults(all=0.006, overtaken=0.0)
        for _ in range(50):
            with Bus(simulator, timeout=0.25) as bus, suppress(drivebus.NoAnswer, drivebus.BadAnswer):
                if bus.drive(1, family).restore(kept, motor=True).ok:
                    break
        simulator.line.clear()
        with Bus(simulator) as bus:
            drive = bus.drive(1, family)
            assert drive.restore(kept, motor=True, serial=True).ok
            assert not drive.diff(kept)
        assert times_stored(simulator, drive) == once(drive, changed)


def test_some_are_changed() -> None:
    """The test above is about something: these families have parameters that can be set."""
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        assert len(unsettle(bus.drive(1, "gd350"))) > 25


@pytest.mark.parametrize("family", WITHOUT)
def test_a_family_without_parameters_says_so(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1, family)
        before = simulator.line.requests
        with pytest.raises(NotAllowed, match="no parameters that are known"):
            drive.backup()
        assert simulator.line.requests == before
