"""No parameter is written to EEPROM twice unasked, wherever a drive stands; the simulated drive's own count judges."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivebus import Backup, Bus, Drive, Profile, Simulator

from .kept import Store
from .limited import accepts, in_any_order, in_any_way

MEMORY = 0x8000
"""The bit of an address that says to which memory a value goes."""
BEYOND = {"P00.03": 50.0, "P00.04": 80.0}
"""P00.04 is above its limit P00.03."""
WANTED = {"P00.03": 70.0, "P00.04": 60.0}
"""60 is above the limit of 50, and 70 is below the 80 that P00.04 has: neither can be written first."""


def beyond_its_limits(drive: Drive, store: Store) -> Backup:
    """A backup with WANTED, of a drive that then has BEYOND: its limit was raised in RAM, and the power was cut."""
    store(drive, WANTED)
    kept = drive.backup()
    store(drive, {"P00.04": 50.0, "P00.03": 50.0})
    drive.bus.write(1, 0x0003 | MEMORY, 9000)
    store(drive, {"P00.04": 80.0})
    return kept


def times(simulator: Simulator, drive: Drive) -> dict[str, int]:
    """How often each was ever written to EEPROM."""
    return {code: simulator.drive(1).eeprom_writes_of(drive.profile.address(code)) for code in WANTED}


@pytest.fixture(params=["gd350", "gd300"])
def family(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def simulator(family: str) -> Iterator[Simulator]:
    with Simulator({1: family}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.mark.parametrize(("family", "unverified"), [("gd350", False), ("gd300", True)])
def test_the_step_on_the_way_goes_to_ram(simulator: Simulator, family: str, unverified: bool, store: Store) -> None:
    """That bit 15 keeps a value out of the EEPROM is printed for the GD350, and assumed of the GD300."""
    with Bus(simulator) as bus:
        drive = bus.drive(1, family, unverified=unverified)
        kept = beyond_its_limits(drive, store)
        simulator.drive(1).power_cycle()
        assert drive.read(*BEYOND) == BEYOND
        before = times(simulator, drive)
        report = drive.restore(kept)
        assert (report.ok, len(report.order)) == (True, 3)
        assert times(simulator, drive) == {code: count + 1 for code, count in before.items()}
        simulator.drive(1).power_cycle()
        assert drive.read(*WANTED) == WANTED


@pytest.mark.parametrize("family", ["gd300"])
def test_without_a_known_ram_nothing_is_written_twice_unasked(simulator: Simulator, store: Store) -> None:
    with Bus(simulator) as bus:
        drive = bus.drive(1, "gd300")
        kept = beyond_its_limits(drive, store)
        simulator.drive(1).power_cycle()
        before = times(simulator, drive)
        for dry_run in (True, False):
            report = drive.restore(kept, dry_run=dry_run)
            assert (report.ok, report.order) == (False, ())
            reasons = {item.code: item.reason for item in report.having("blocked")}
            assert {*reasons} == {*WANTED}
            assert reasons["P00.04"].startswith("it would be beyond P00.03, which the drive has at 50.00 Hz; ")
            assert all("twice=True" in reason for reason in reasons.values())
        assert times(simulator, drive) == before

        assert drive.restore(kept, twice=True).ok
        written = [count - before[code] for code, count in times(simulator, drive).items()]
        assert sorted(written) == [1, 2]
        simulator.drive(1).power_cycle()
        assert drive.read(*WANTED) == WANTED


@pytest.mark.parametrize("family", ["gd350"])
def test_a_step_whose_end_is_refused_is_told(
    simulator: Simulator, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Bus(simulator) as bus:
        drive = bus.drive(1, "gd350")
        kept = beyond_its_limits(drive, store)
        simulator.drive(1).power_cycle()
        write = Bus.write

        def refusing(bus: Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
            write(bus, unit, 0x6300 if address == 0x0003 else address, value, **how)

        monkeypatch.setattr(Bus, "write", refusing)
        report = drive.restore(kept)
    [refused] = report.having("refused")
    assert (refused.code, refused.before, refused.after) == ("P00.03", 50.0, 80.0)
    assert refused.reason.endswith("; on the way there it was given 80.00 Hz")
    assert [item.code for item in report.having("restored")] == ["P00.04"]


SOME = {
    "gd350": ["P00.11", "P00.12", "P01.20"],
    "gd300": ["P00.11", "P00.12", "P01.20"],
    "gd600": ["P00.01", "P00.06", "P10.00"],
    "gd3000": ["P00.01", "P01.19", "P01.20"],
    "vfd500": ["P07.01", "P07.02", "P07.03"],
}
"""Three parameters of each family that take any of 0, 1 and 2, whatever the others are."""
KEEPS_IN_RAM = ("gd350", "vfd500")
"""Families of which that is documented."""
VALUES = st.lists(st.integers(0, 2), min_size=3, max_size=3)


@pytest.fixture(params=SOME, scope="module")
def bounded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Profile:
    """A family in which the first of the three is never above the second, nor that above the third."""
    family, folder = str(request.param), tmp_path_factory.mktemp("bounded")
    low, middle, high = (Profile.builtin(family).describe(code) for code in SOME[family])
    head = "code,name,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source"
    ends = [(low, "", ""), (middle, low.code, high.code), (high, "", "")]
    rows = [f"{each.code},{each.name},test,,1,no,,{below},,{above},,run,,yes,,test" for each, below, above in ends]
    (folder / "parameters.csv").write_text("\n".join([head, *rows]))
    overlay = f'name = "bounded"\nversion = 1\nsource = "test"\n[overlay]\nprofile = "{family}"\n'
    (folder / "profile.toml").write_text(overlay)
    return Profile.load(folder)


@given(had=VALUES, wanted=VALUES.map(sorted), twice=st.booleans())
def test_from_any_values_to_any(bounded: Profile, had: list[int], wanted: list[int], twice: bool) -> None:
    codes = {bounded.address(code): code for code in SOME[bounded.family]}
    pairs = list(itertools.pairwise(codes.values()))
    now, end = (dict(zip(codes.values(), map(float, values), strict=True)) for values in (had, wanted))
    changing = {code: value for code, value in end.items() if value != now[code]}
    reaches = in_any_way if twice or bounded.family in KEEPS_IN_RAM else in_any_order
    write = Bus.write
    with Simulator({1: bounded.family}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive, machine = bus.drive(1, bounded), simulator.drive(1)
        for code, value in now.items():
            bus.write(1, bounded.address(code, store=True), int(value))
        kept = Backup(drive.backup().origin, {code: int(value) for code, value in end.items()}, {}, bounded)
        before = {code: machine.eeprom_writes_of(address) for address, code in codes.items()}

        def limited(bus: Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
            state = {code: float(machine.register(place)) for place, code in codes.items()}
            # 6300H is nowhere: the drive itself refuses.
            taken = accepts(state, pairs, codes[address & ~MEMORY], value)
            write(bus, unit, address if taken else 0x6300, value, **how)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Bus, "write", limited)
            plan = drive.restore(kept, dry_run=True, twice=twice)
            report = drive.restore(kept, twice=twice)
        machine.power_cycle()
        has = {code: float(machine.register(place)) for place, code in codes.items()}
        worn = {code: machine.eeprom_writes_of(place) - before[code] for place, code in codes.items()}

    assert plan.order == report.order
    assert not report.having("refused")
    assert report.ok == (has == end) == reaches(now, changing, pairs)
    most = 2 if twice and bounded.family not in KEEPS_IN_RAM and not in_any_order(now, changing, pairs) else 1
    assert all(count <= (most if code in changing else 0) for code, count in worn.items())
