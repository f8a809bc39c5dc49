"""A backup on a simulated line: what is asked, what is named, and what a break costs."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Backup, Bus, Drive, NotAllowed, Profile, Simulator

from .kept import OTHER, Store


@pytest.fixture
def drive(virtual_bus: Bus) -> Drive:
    return virtual_bus.drive(1, "gd350")


def test_every_parameter_is_read_in_the_fewest_reads(virtual: Simulator, drive: Drive) -> None:
    drive.read("P00.01")  # the bus knows the drive
    before = virtual.line.requests
    taken = drive.backup()
    every = [name for name in drive.profile.names() if name.startswith("P")]
    assert {*taken, *taken.unread} == {*every}
    readable = [name for name in every if name not in ("P02.01", "P07.00")]
    # Two more ask who it is, for the file and to know it again.
    assert virtual.line.requests - before == len(drive.profile.compile(readable).reads) + 2
    assert virtual.drive(1).words_written == 0


def test_what_is_only_assumed_is_read_where_that_is_asked_for(virtual_bus: Bus, drive: Drive) -> None:
    taken = drive.backup()
    assert taken.unread["P02.01"].startswith("it is only assumed that this family has it: ")
    assert "P02.01" in drive.backup(unverified=True)
    whole = virtual_bus.drive(1, "gd350", unverified=True).backup()
    assert "P02.01" in whole
    for asked in (False, True):
        found = drive.diff(whole, unverified=asked)
        report = {item.code: item.result for item in drive.restore(whole, motor=True, unverified=asked)}
        assert (len(found), "P02.01" in found.uncompared) == (0, not asked)
        assert report["P02.01"] == ("same" if asked else "skipped")


def test_progress_counts_to_the_end(drive: Drive) -> None:
    seen: list[tuple[int, int]] = []
    taken = drive.backup(progress=lambda done, total: seen.append((done, total)))
    assert seen[0] == (0, len(taken))
    assert seen[-1] == (len(taken), len(taken))
    assert seen == sorted(seen)


def test_one_that_is_refused_is_named_and_costs_no_other(drive: Drive, without: Callable[[int], None]) -> None:
    """A drive whose firmware has no P00.12."""
    without(0x000C)
    taken = drive.backup()
    assert "exception 02H, illegal_address: there is no such address" in taken.unread["P00.12"]
    assert {*taken.unread} == {"P02.01", "P07.00", "P00.12"}
    assert {"P00.10", "P00.11", "P00.14"} <= {*taken}


def test_what_this_program_put_into_ram_alone_is_marked(drive: Drive, tmp_path: Path) -> None:
    drive.write({"P00.11": 3.0, "P00.12": 4.0})
    drive.write("P00.12", 4.0, store=True)
    kept = drive.backup(tmp_path / "drive.toml")
    assert kept.in_ram == {"P00.11"}
    marked = [line for line in kept.text().splitlines() if "in RAM alone" in line]
    assert [line.split(" ")[0] for line in marked] == ["P00.11"]
    assert Backup.load(tmp_path / "drive.toml").raw == kept.raw


def test_a_locked_drive_ends_it(drive: Drive, virtual: Simulator, store: Store) -> None:
    store(drive, {"P07.00": 1234})
    before = virtual.line.requests
    with pytest.raises(drivebus.Refused, match="password"):
        drive.backup()
    assert virtual.line.requests - before <= 3  # who it is, twice, and the first read


@pytest.mark.parametrize("broken_at", [3, 10, 21])
def test_a_break_costs_nothing_that_was_read(
    virtual: Simulator, drive: Drive, tmp_path: Path, broken_at: int, store: Store
) -> None:
    path, part = tmp_path / "drive.toml", tmp_path / "drive.toml.part"
    store(drive, OTHER)
    whole = drive.backup()
    start = virtual.line.requests

    def progress(*_: int) -> None:
        if virtual.line.requests - start >= broken_at:
            virtual.line.unplug()

    with pytest.raises(drivebus.PortError):
        drive.backup(path, progress=progress)
    assert part.exists()
    assert not path.exists()
    half = len(Backup.load(part))
    virtual.line.replug()
    seen: list[int] = []
    again = drive.backup(path, progress=lambda done, _: seen.append(done))
    assert (seen[0], again.raw) == (half, whole.raw)
    assert (part.exists(), Backup.load(path).complete) == (False, True)
    assert 0 < half < len(whole)


@pytest.mark.parametrize("use", ["backup", "diff", "restore"])
def test_nothing_is_taken_of_another_drive_behind_the_port(
    virtual_bus: Bus, drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, use: str
) -> None:
    """Another thread opened the port again, and the cable leads elsewhere now."""
    path = tmp_path / "drive.toml"
    drive.backup(path)
    read, count = Bus.read, [0]

    def elsewhere(bus: Bus, unit: int, first: int, words: int = 1, /, **how: Any) -> list[int]:
        count[0] += 1
        found = read(bus, unit, first, words, **how)
        return [0x01A2] if first == 0x2103 and count[0] > 8 else found

    monkeypatch.setattr(Bus, "read", elsewhere)
    monkeypatch.setattr(Bus, "reconnects", property(lambda _: int(count[0] > 8)))
    with pytest.raises(NotAllowed, match="another drive answers as unit 1 since the port was opened again"):
        getattr(virtual_bus.drive(1, "gd350"), use)(path)


def test_what_was_changed_by_hand_meanwhile_is_read_again(drive: Drive, tmp_path: Path) -> None:
    part = tmp_path / "drive.toml.part"
    whole = drive.backup()
    begun = whole.text().replace("complete = true", "complete = false")
    part.write_text(begun.replace('value = 4.0, unit = "kHz", raw = 40,', 'value = 5.0, unit = "kHz", raw = 50,'))
    assert Backup.load(part).raw["P00.14"] == 50
    assert drive.backup(tmp_path / "drive.toml").raw == whole.raw


def test_a_half_backup_is_neither_restored_nor_compared(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    text = drive.backup(path).text().replace("complete = true", "complete = false")
    path.write_text(text)
    for use in (drive.restore, drive.diff):
        with pytest.raises(NotAllowed, match="never completed"):
            use(path)


def test_what_another_drive_left_is_not_gone_on_with(virtual_bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    part = tmp_path / "drive.toml.part"
    first, second = virtual_bus.drive(1, "gd350"), virtual_bus.drive(2, "gd350")
    part.write_text(first.backup().text().replace("complete = true", "complete = false"))
    with pytest.raises(NotAllowed, match="begun with another drive: its unit is 1, not 2"):
        second.backup(path)
    assert second.backup(path, resume=False).origin.unit == 2


def test_a_file_of_something_else_is_not_replaced(virtual_bus: Bus, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    first, second = virtual_bus.drive(1, "gd350"), virtual_bus.drive(2, "gd350")
    first.backup(path)
    first.backup(path)
    with pytest.raises(NotAllowed, match="backup of another drive: its unit is 1, not 2"):
        second.backup(path)
    path.write_text("my notes")
    with pytest.raises(NotAllowed, match="would be replaced"):
        first.backup(path)
    assert path.read_text() == "my notes"
    first.backup(path, force=True)
    assert Backup.load(path).origin.unit == 1


def test_the_awaited_drive_does_the_same(tmp_path: Path) -> None:
    async def awaited() -> None:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1)
                kept = await drive.backup(tmp_path / "drive.toml")
                await drive.write("P00.11", 3.0, store=True, unverified=True)
                assert [each.code for each in await drive.diff(kept)] == ["P00.11"]
                assert (await drive.restore(tmp_path / "drive.toml")).ok
                assert not await drive.diff(kept)

    asyncio.run(awaited())


@pytest.fixture
def guessed(tmp_path: Path) -> Profile:
    """A family of which it is only assumed where it says what it is."""
    head = "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source"
    row = "0x2103,identification_code,What it is,,1,no,,,,ro,assumed,A sister has it there.,notes"
    (tmp_path / "registers.csv").write_text(f"{head}\n{row}\n")
    (tmp_path / "profile.toml").write_text(
        'name = "ours"\nversion = 1\nsource = "notes"\n[overlay]\nprofile = "gd350"\n'
    )
    return Profile.load(tmp_path)


@pytest.mark.parametrize("drive_trusts", [False, True])
@pytest.mark.parametrize("call_trusts", [False, True])
def test_who_it_is_is_asked_with_the_trust_of_the_call(
    virtual_bus: Bus, guessed: Profile, drive_trusts: bool, call_trusts: bool
) -> None:
    drive = virtual_bus.drive(1, guessed, unverified=drive_trusts)
    trusts = drive_trusts or call_trusts
    kept = drive.backup(unverified=call_trusts)
    assert kept.origin.identification == (0x01A0 if trusts else None)
    assert not drive.diff(kept, unverified=call_trusts)
    assert drive.restore(kept, unverified=call_trusts).ok
