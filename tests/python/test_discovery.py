"""Which parameters a drive has: exactly those of the simulated drive, by reads alone, however the line behaves."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, NoAnswer, NotAllowed, Profile, Simulator
from drivebus.backup.unread import Unread
from drivebus.discovery.group_scan import LAST, Walk
from drivebus.sim import FAULT_KINDS

FAMILIES = [name for name in sorted(drivebus.profiles()) if Profile.builtin(name).parameter_groups()]
"""Those whose codes tell their addresses: of any other there is no code to try."""

LISTED = sorted({*drivebus.profiles()} - {*FAMILIES})

MOST = {"gd350": 9_900, "vfd500": 10_400}
"""Reads: one for each number that is not there, and some for each run."""


@contextmanager
def on_a_bus(family: str, faults: Mapping[str, float] | None = None, seed: int = 0) -> Iterator[tuple[Simulator, Bus]]:
    """A simulated drive in virtual time, and its line."""
    with (
        Simulator({1: family}, transport="process", clock="virtual", faults=faults, seed=seed) as simulator,
        Bus(simulator) as bus,
    ):
        yield simulator, bus


@contextmanager
def of(family: str, faults: Mapping[str, float] | None = None, seed: int = 0) -> Iterator[tuple[Simulator, Drive]]:
    """The same, and the handle of the drive."""
    with on_a_bus(family, faults, seed) as (simulator, bus):
        yield simulator, bus.drive(1, profile=family)


def there(simulator: Simulator, profile: Profile) -> dict[int, int]:
    """What the simulated drive has in the groups of parameters, by address: it was typed apart from the profile."""
    found = {}
    for group in profile.parameter_groups():
        for address in range(group << 8, (group << 8) + LAST + 1):
            try:
                found[address] = simulator.drive(1).register(address)
            except NotAllowed:
                continue
    return found


def address_of(code: str) -> int:
    """Where *code* is, by the rule of the family."""
    group, _, index = code[1:].partition(".")
    return int(group) << 8 | int(index)


@pytest.mark.parametrize("family", FAMILIES)
def test_exactly_what_is_there_is_found(family: str) -> None:
    with of(family) as (simulator, drive):
        found = drive.discover()
        profile = drive.profile
        have = there(simulator, profile)
        second = {
            known.address + 1 for known in map(profile.describe, profile.names()) if known.words == 2 and known.address
        }
        # Its counters of frames went on while it was asked.
        counters = {address_of(code) for code in ("r30.06", "r30.07")} if family == "vfd500" else set()
        told = {address_of(code): word for code, word in found.words.items()}
        assert {*told} == {*have} - second
        assert {address for address in told if told[address] != have[address]} <= counters
        assert len(found.unlisted) > 90
        assert not found.refused
        assert not found.doubtful
        assert found.missing == []
        assert simulator.drive(1).writes() == []
        assert found.requests <= MOST.get(family, 10_400)


@pytest.mark.parametrize("family", ["atv312", "v20", "acs355"])
def test_where_codes_do_not_tell_their_addresses_nothing_is_tried(family: str) -> None:
    with of(family) as (simulator, drive):
        with pytest.raises(NotAllowed):
            drive.discover()
        assert simulator.line.requests == 0


def test_closed_groups_and_registers_are_left_alone() -> None:
    assert Profile.builtin("gd350").parameter_groups() == [*range(32), *range(34, 48), *range(49, 80), *range(81, 99)]
    # 7000H is beyond every group, and 2000H is a parameter of this family.
    assert Profile.builtin("vfd500").parameter_groups() == [*range(100)]


class Cut(Exception):
    """The program ends here."""


def test_cut_off_at_random_moments_it_comes_to_the_same_folder(tmp_path: Path) -> None:
    with of("gd350") as (_, drive):
        drive.discover(tmp_path / "whole")
    chance = random.Random(15)
    reads = sorted(chance.randrange(1, 9_800) for _ in range(20))
    with of("gd350") as (simulator, drive):
        link, asked = drive.bus, 0
        read = link.read

        def cut(*words: object, **options: object) -> object:
            nonlocal asked
            asked += 1
            if reads and asked == reads[0]:
                reads.pop(0)
                raise Cut
            return read(*words, **options)  # type: ignore[arg-type]

        cuts = 0
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(type(link), "read", lambda _self, *words, **options: cut(*words, **options))
            while True:
                try:
                    drive.discover(tmp_path / "pieces")
                    break
                except Cut:
                    cuts += 1
                    assert (tmp_path / "pieces.part").exists()
                    assert not (tmp_path / "pieces").exists()
        assert simulator.drive(1).writes() == []
    assert cuts == 20
    for name in ("parameters.csv", "profile.toml"):
        whole, pieces = ((tmp_path / folder / name).read_text() for folder in ("whole", "pieces"))
        assert whole == pieces.replace("pieces", "whole")
    assert not (tmp_path / "pieces.part").exists()


def test_a_hostile_line_leads_to_the_same_rows() -> None:
    hostile = {kind: 0.02 for kind in FAULT_KINDS if kind != "unplug"}
    tables = []
    for faults in ({}, hostile):
        with of("gd350", faults=faults, seed=7) as (_, drive):
            tables.append(drive.discover().table())
    assert tables[0] == tables[1]


def test_what_was_found_is_a_profile_to_go_on_with(tmp_path: Path) -> None:
    with on_a_bus("gd350") as (simulator, bus):
        bus.drive(1, profile="gd350").discover(tmp_path / "pump3", groups=["P05", "P12"])
        assert Profile.check(tmp_path / "pump3") == []
        own = bus.drive(1, profile=tmp_path / "pump3")
        assert own.read("P05.22") == 7
        assert own.describe("P05.22").evidence == "unverified"
        with pytest.raises(NotAllowed, match="unverified"):
            own.write("P05.22", 9)
        own.write("P05.22", 9, unverified=True)
        # RAM alone, by the family's rule.
        assert [(address, word) for _, address, word in simulator.drive(1).writes()] == [(0x8516, 9)]


@pytest.mark.parametrize("family", LISTED)
def test_where_codes_tell_no_address_nothing_is_asked(family: str) -> None:
    with of(family) as (simulator, drive):
        with pytest.raises(NotAllowed, match="do not tell addresses"):
            drive.discover()
        assert simulator.line.requests == 0


COMMANDED = [name for name in FAMILIES if Profile.builtin(name).command_address is not None]
"""Families of which it is known where they take commands. Nothing is written to a code of others that no row lists."""


@pytest.mark.parametrize("family", sorted({*FAMILIES} - {*COMMANDED}))
def test_what_might_be_a_command_is_only_read(family: str, tmp_path: Path) -> None:
    with on_a_bus(family) as (simulator, bus):
        bus.drive(1, profile=family).discover(tmp_path / "mine", groups=["P05"])
        for profile in (family, tmp_path / "mine"):
            own = bus.drive(1, profile=profile, unverified=True)
            assert own.read("P05.03") == 3
            with pytest.raises(NotAllowed, match="is read-only"):
                own.write("P05.03", 33, store=True)
        assert simulator.drive(1).words_written == 0


@pytest.mark.parametrize("family", COMMANDED)
def test_it_is_kept_and_given_back_by_name(family: str, tmp_path: Path) -> None:
    with on_a_bus(family) as (simulator, bus):
        bus.drive(1, profile=family).discover(tmp_path / "mine", groups=["P05"])
        own = bus.drive(1, profile=tmp_path / "mine", unverified=True)
        own.write({"P05.03": 33, "P05.40": 44}, store=True)
        own.backup(tmp_path / "kept.toml")
        simulator.drive(1).factory_reset()
        assert (own.read("P05.03"), own.read("P05.40")) == (3, 100)
        left = own.restore(tmp_path / "kept.toml", dry_run=True)
        assert not left.having("planned")
        assert "raw=[…]" in next(item.reason for item in left if item.code == "P05.03")
        with pytest.raises(NotAllowed, match=r"P05\.77"):
            own.restore(tmp_path / "kept.toml", raw=["P05.77"])
        done = own.restore(tmp_path / "kept.toml", raw=["P05.03", "P05.40"])
        assert {item.code for item in done.having("restored")} == {"P05.03", "P05.40"}
        assert not own.diff(tmp_path / "kept.toml")
        simulator.drive(1).power_cycle()
        assert (own.read("P05.03"), own.read("P05.40")) == (33, 44)


def test_what_was_in_ram_goes_back_to_ram(tmp_path: Path) -> None:
    with on_a_bus("gd350") as (simulator, bus):
        bus.drive(1, profile="gd350").discover(tmp_path / "mine", groups=["P05"])
        own = bus.drive(1, profile=tmp_path / "mine", unverified=True)
        own.write("P05.03", 33)
        own.backup(tmp_path / "kept.toml")
        assert (
            'P05.03 = { value = 33, unit = "raw", raw = 33, told = 33, ram = true }'
            in (tmp_path / "kept.toml").read_text()
        )
        simulator.drive(1).power_cycle()
        simulator.drive(1).take_writes()
        own.restore(drivebus.Backup.load(tmp_path / "kept.toml", own.profile), raw=["P05.03"])
        assert [(address, word) for _, address, word in simulator.drive(1).writes()] == [(0x8503, 33)]
        assert simulator.drive(1).eeprom_writes == 0


def test_a_lost_drive_ends_it_and_what_was_found_is_kept(tmp_path: Path) -> None:
    with of("gd350") as (simulator, drive):
        done: list[int] = []

        def progress(group: int, _groups: int) -> None:
            done.append(group)
            if group == 6:
                simulator.line.set_faults(silence=1.0)

        with pytest.raises(NoAnswer) as error:
            drive.discover(tmp_path / "mine", progress=progress)
        assert done == [*range(7)]
        kept = json.loads((tmp_path / "mine.part").read_text())
        assert [*kept["groups"]] == [str(group) for group in range(6)]
        if hasattr(error.value, "__notes__"):
            assert "6 of 95 groups" in error.value.__notes__[0]


def test_a_group_that_answers_everything_is_not_believed() -> None:
    # A drive whose group has no end: 100 numbers and the one that no parameter has.
    walk = Walk(16)
    while (asked := walk.ask()) is not None:
        walk.answered([7] * asked[1])
    assert (len(walk.found), walk.refused) == (LAST + 1, {})


@pytest.mark.parametrize("most", [1, 5, 12, 16])
def test_the_walk_finds_what_is_there_in_few_reads(most: int) -> None:
    """Against a set of numbers made up: each read is answered if all of it is there."""
    chance = random.Random(most)
    for _ in range(300):
        have: set[int] = set()
        for _ in range(chance.randrange(6)):
            first = chance.randrange(LAST + 1)
            have |= {*range(first, min(LAST, first + chance.randrange(40)) + 1)}
        walk, reads = Walk(most), 0
        while (asked := walk.ask()) is not None:
            first, count = asked
            reads += 1
            assert 1 <= count <= most
            assert first + count <= LAST + 1
            if have >= {*range(first, first + count)}:
                walk.answered([1000 + number for number in range(first, first + count)])
            else:
                walk.was_refused(count, Unread("", "not there"))
        assert walk.found == {number: 1000 + number for number in have}
        assert {*walk.refused} == {*range(LAST + 1)} - have
        runs = sum(number - 1 not in have for number in have)
        # One for each that is not there, one for each full read, and a search for the end of each run.
        assert reads <= LAST + 1 - len(have) + len(have) // most + (runs + 1) * (2 * most.bit_length() + 1)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"groups": ["P99"]}, "P99"),
        ({"groups": ["P5"]}, "not a group that can be searched"),
        ({"groups": "P05"}, "not a list of groups"),
        ({"groups": []}, "not a list of groups"),
        ({"folder": "No Name"}, "cannot be the name of a profile"),
        ({"folder": "gd350"}, "shipped profile"),
        ({"folder": "."}, "cannot be the name|is there already"),
    ],
    ids=str,
)
def test_what_is_wrong_is_said_before_anything_is_asked(
    options: dict[str, object], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with on_a_bus("gd350") as (_, bus):
        drive = bus.drive(1, profile="gd350")
        before = bus.stats().requests
        with pytest.raises(NotAllowed, match=said):
            drive.discover(**options)  # type: ignore[arg-type]
        assert bus.stats().requests == before


def test_what_is_in_the_folder_stays(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "profile.toml").write_text("edited")
    with of("gd350") as (_, drive), pytest.raises(NotAllowed, match="is there already"):
        drive.discover(tmp_path / "mine")
    assert (tmp_path / "mine" / "profile.toml").read_text() == "edited"


def test_another_drive_is_not_asked(tmp_path: Path) -> None:
    with on_a_bus("gd300") as (_, bus), pytest.raises(NotAllowed, match="Goodrive300"):
        bus.drive(1, profile="gd350").discover(tmp_path / "mine")


def test_the_rest_of_another_drive_is_not_gone_on_with(tmp_path: Path) -> None:
    with of("gd350") as (_, drive), pytest.raises(ZeroDivisionError):
        drive.discover(tmp_path / "mine", progress=lambda group, _: 1 // (3 - group))
    with of("gd600") as (_, drive), pytest.raises(NotAllowed, match="begun with another drive"):
        drive.discover(tmp_path / "mine")
    (tmp_path / "mine.part").write_text("[]")
    with of("gd600") as (_, drive), pytest.raises(NotAllowed, match="interrupted discovery"):
        drive.discover(tmp_path / "mine")
