"""No write by a name that the unit did not confirm is kept in EEPROM by a drive of another family, or starts it.

Whatever hangs at the address may be busy, locked or out of reach when it is asked what it is. A profile names places
that another family keeps in EEPROM, or takes commands at: 8F01H is P14.01 in RAM of a Goodrive and in EEPROM of a
VFD500. The judge is the simulated drive. `make test` runs every seventh pair; `DRIVEBUS_MATRIX=all` runs them all.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import pytest
from click.testing import CliRunner

import drivebus
from drivebus import Bus, DrivebusError, NotAllowed, Profile, Simulator
from drivebus.cli import cli

from .matrix import ALL

STEP = 1 if ALL else 7
FAMILIES = drivebus.profiles()

REFUSALS = {"at once": None, "illegal": 0x07, "busy": 0x06, "locked": 0x09, "out of reach": 0x0B}
"""By what it refuses to be read. 09H: a password locks an INVT (GD350 manual, section 9.4.7)."""


class Write(NamedTuple):
    """A name of one family, at a place that matters to another."""

    name: str
    store: bool
    value: float


def kept_elsewhere(named: Profile, real: Profile) -> Iterator[Write]:
    """Of each kind of row of *named* one that *real* keeps in EEPROM, as its own rows and memory rule say."""
    found: dict[tuple[str, bool], Write] = {}
    for row in map(named.describe, named.names()):
        if row.access not in ("run", "stop", "rw") or row.place is None or row.place >> 16:
            continue
        for store in (False, True) if row.kind == "parameter" else (False,):
            if (row.kind == "parameter" and not store and named.memory() is None) or named.is_command(row.place):
                continue
            address = named.address(row.name, store=store)
            if is_kept(real, address):
                found.setdefault((row.kind, store), Write(row.name, store, row.low or 0))
    yield from found.values()


def is_kept(real: Profile, address: int) -> bool:
    plain = real.plain_address(address)
    name = real.name_at(plain, written=True)
    if name is None or real.describe(name).kind != "parameter" or real.describe(name).access == "ro":
        return False
    memory = real.memory()
    if memory is not None and memory["bit"] is None:
        return False  # it stays in RAM until all is stored
    return memory is None or bool(address >> memory["bit"] & 1) == (memory["means"] == "eeprom")


def try_to_write(named: Profile, real: str, write: Write, exception: int | None) -> str | None:
    """What came of it, where the unit was changed by it."""
    with Simulator({1: real}, transport="process", clock="virtual") as simulator:
        unit = simulator.drive(1)
        before = (unit.state, unit.eeprom_writes)
        if exception is not None:
            unit.refuse(exception, asked="reads")
        said = "returned"
        with Bus(simulator) as bus:
            try:
                bus.drive(1, named, unverified=True).write(write.name, write.value, store=write.store)
            except DrivebusError as error:
                said = f"{type(error).__name__}: {error}"
        return None if (unit.state, unit.eeprom_writes) == before else f"{write} by 03H = {exception}: {said}"


def others(named: str) -> list[str]:
    """The families that a unit named *named* may be instead: of all pairs each seventh, or all."""
    begin = FAMILIES.index(named)
    return [real for number, real in enumerate(FAMILIES) if real != named and (number + begin) % STEP == 0]


@pytest.mark.parametrize("named", FAMILIES)
def test_one_that_does_not_say_what_it_is_keeps_nothing(named: str) -> None:
    profile = Profile.builtin(named)
    changed = [
        (real, told)
        for real in others(named)
        for write in kept_elsewhere(profile, Profile.builtin(real))
        for exception in REFUSALS.values()
        if (told := try_to_write(profile, real, write, exception)) is not None
    ]
    assert changed == []


def test_there_is_something_to_keep() -> None:
    tried = [
        (named, real, write)
        for named in FAMILIES
        for real in FAMILIES
        if real != named
        for write in kept_elsewhere(Profile.builtin(named), Profile.builtin(real))
    ]
    assert len(tried) > 100
    assert ("gd350", "vfd500") in {(named, real) for named, real, _ in tried}


@pytest.mark.parametrize("exception", [0x06, 0x07, 0x09, 0x0B])
def test_what_is_named_rightly_is_told_why_it_waits(exception: int) -> None:
    """It may be another one, for all that is known; nothing left, and what to do stands in the error."""
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        simulator.drive(1).refuse(exception, asked="reads")
        drive = bus.drive(1, "gd350")
        with pytest.raises(DrivebusError, match="nothing was written") as unsaid:
            drive.write_words(0x000B, 20)
        assert unsaid.value.started is None
        assert simulator.drive(1).writes() == []
        simulator.drive(1).refuse_no_more()
        drive.write_words(0x000B, 20)
        assert simulator.drive(1).eeprom_writes == 1


def test_whose_name_is_said_to_be_meant_is_written_to() -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        simulator.drive(1).refuse(0x06, asked="reads", count=30)
        bus.drive(1, "gd350", trust_profile=True).write_words(0x000B, 20)
        assert simulator.drive(1).eeprom_writes == 1


@pytest.fixture(scope="module")
def mine(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Profile]:
    """Profiles of somebody's own that began as those of the shipped families, as `profiles new --like` makes them.

    Their names say nothing to anybody: no list has what speaks against them.
    """
    folder = tmp_path_factory.mktemp("own")
    for like in FAMILIES:
        made = CliRunner().invoke(cli, ["profiles", "new", str(folder / f"my-{like}"), "--like", like])
        assert made.exit_code == 0, made.output
    return {like: Profile.load(folder / f"my-{like}") for like in FAMILIES}


class TestOfSomebodysOwn:
    @pytest.mark.parametrize("like", FAMILIES)
    @pytest.mark.parametrize("trusted", [False, True], ids=["named", "trusted"])
    def test_no_halt_by_its_name_starts_anything(self, mine: dict[str, Profile], like: str, trusted: bool) -> None:
        for real in others(like):
            for command in {"stop", "coast", "jog_stop", "reset_fault"} & {*mine[like].commands()}:
                with Simulator({1: real}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
                    unit = simulator.drive(1)
                    before = (unit.state, unit.eeprom_writes)
                    drive = bus.drive(1, mine[like], unverified=True, trust_profile=trusted)
                    for _ in range(2):  # what was heard the first time leaves no hole
                        with suppress(DrivebusError):
                            getattr(drive, command)()
                        bus.sleep(20.0)
                        assert (unit.state, unit.eeprom_writes) == before, f"{command} to a {real}"

    @pytest.mark.parametrize("like", FAMILIES)
    def test_no_write_by_its_name_is_kept(self, mine: dict[str, Profile], like: str) -> None:
        changed = [
            (real, told)
            for real in others(like)
            for write in kept_elsewhere(mine[like], Profile.builtin(real))
            for exception in REFUSALS.values()
            if (told := try_to_write(mine[like], real, write, exception)) is not None
        ]
        assert changed == []

    @pytest.mark.parametrize("real", FAMILIES)
    @pytest.mark.parametrize("address", [0x000B, 0x0E01, 0x8E01, 0x2000, 0x1000])
    def test_no_word_at_an_address_changes_anything(self, real: str, address: int) -> None:
        """The made-up EX-9, with 1 as any of its words."""
        ex9 = Profile.load(Path(__file__).resolve().parent.parent / "vectors/profiles/ex9")
        with Simulator({1: real}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            unit = simulator.drive(1)
            before = (unit.state, unit.eeprom_writes)
            # One that speaks no Modbus is silent.
            with suppress(NotAllowed, drivebus.Refused, drivebus.NoAnswer):
                bus.drive(1, ex9, unverified=True).write_words(address, 1, force=True)
            assert (unit.state, unit.eeprom_writes) == before
