"""A restore on a simulated line: what is written and when, what is left alone, and what is told of the rest."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drivebus import Backup, Bus, Drive, NoAnswer, NotAllowed, Simulator

from .kept import OTHER, RAM, Store, stored


@pytest.fixture
def drive(virtual_bus: Bus) -> Drive:
    return virtual_bus.drive(1, "gd350")


@pytest.mark.parametrize("up", [True, False])
def test_limits_and_values_come_back(virtual: Simulator, drive: Drive, up: bool, store: Store) -> None:
    """P00.03 is never below P00.04: raised first, lowered last."""
    low, high = {"P00.03": 50.0, "P00.04": 50.0}, {"P00.03": 90.0, "P00.04": 80.0}
    store(drive, high)
    if not up:
        store(drive, {"P00.04": 50.0})
        store(drive, {"P00.03": 50.0})
    now, wanted = (low, high) if not up else (high, low)
    kept = drive.backup()
    store(drive, dict(reversed(wanted.items())) if up else wanted)
    stored(virtual)
    report = drive.restore(kept)
    assert report.ok
    assert drive.read("P00.03", "P00.04") == now
    # Up: P00.03 at 0003H comes first. Down: P00.04 at 0004H does.
    assert stored(virtual) == ([3, 4] if up else [4, 3])


def test_only_what_differs_is_written_once_and_to_stay(virtual: Simulator, drive: Drive, store: Store) -> None:
    kept = drive.backup()
    store(drive, OTHER)
    stored(virtual)
    assert {each.code for each in drive.diff(kept)} == {*OTHER}
    report = drive.restore(kept)
    assert {item.code for item in report.having("restored")} == {*OTHER}
    assert sorted(stored(virtual)) == sorted(drive.profile.address(code) for code in OTHER)
    virtual.drive(1).power_cycle()
    assert not drive.diff(kept)
    assert drive.restore(kept).having("restored") == []


def test_what_is_only_in_ram_is_stored_all_the_same(virtual: Simulator, drive: Drive, store: Store) -> None:
    store(drive, {"P00.11": 3.0})
    kept = drive.backup()
    store(drive, {"P00.11": 5.0})
    drive.write("P00.11", 3.0)
    assert [item.code for item in drive.restore(kept).having("restored")] == ["P00.11"]
    virtual.drive(1).power_cycle()
    assert drive.read("P00.11") == 3.0


def test_a_dry_run_writes_nothing_and_says_the_same(virtual: Simulator, drive: Drive, store: Store) -> None:
    kept = drive.backup()
    store(drive, OTHER)
    stored(virtual)
    plan = drive.restore(kept, dry_run=True)
    assert (virtual.drive(1).take_writes(), plan.dry_run, plan.ok) == ([], True, True)
    report = drive.restore(kept)
    assert plan.order == report.order
    assert [item.code for item in plan.having("planned")] == [item.code for item in report.having("restored")]


@pytest.mark.parametrize(
    "line",
    [
        'P00.14 = { value = 5.0, unit = "kHz", raw = 50, told = 40 }',
        "P00.14 = { value = 5.0, told = 40 }",
        "P00.14 = { value = 5.0, raw = 50 }",
    ],
)
def test_what_was_changed_by_hand_and_is_not_verified_needs_to_be_asked_for(
    virtual: Simulator, drive: Drive, tmp_path: Path, line: str
) -> None:
    """That P00.14 of a GD350 is the carrier frequency, in tenths of a kilohertz, is printed for sister series only."""
    path = tmp_path / "drive.toml"
    lines = drive.backup(path).text().splitlines()
    [mine] = [index for index, text in enumerate(lines) if text.startswith("P00.14 = ")]
    assert lines[mine].startswith('P00.14 = { value = 4.0, unit = "kHz", raw = 40, told = 40 }')
    lines[mine] = line
    path.write_text("\n".join(lines))
    for dry_run in (True, False):
        report = drive.restore(path, dry_run=dry_run)
        [item] = report.having("blocked")
        assert (item.code, report.ok) == ("P00.14", False)
        assert "not what the drive told" in item.reason
        assert "unverified=True" in item.reason
    assert stored(virtual) == []
    assert [item.code for item in drive.restore(path, unverified=True).having("restored")] == ["P00.14"]
    assert stored(virtual) == [0x000E]
    assert drive.restore(path).ok


def test_what_was_changed_by_hand_and_is_verified_is_written(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    text = (
        drive.backup(path)
        .text()
        .replace('P00.11 = { value = 10.0, unit = "s", raw = 100 }', "P00.11 = { value = 3.0 }")
    )
    path.write_text(text)
    assert [item.code for item in drive.restore(path).having("restored")] == ["P00.11"]
    assert drive.read("P00.11") == 3.0


def test_sources_of_commands_come_last(drive: Drive, store: Store) -> None:
    drive.prepare_control(store=True)
    store(drive, {"P00.11": 3.0})
    kept = drive.backup()
    store(drive, {"P00.01": 0, "P00.06": 0, "P00.11": 5.0})
    assert drive.restore(kept).order == ("P00.11", "P00.06", "P00.01")


def test_serial_settings_and_motor_data_only_where_that_is_asked(drive: Drive, store: Store) -> None:
    kept = drive.backup()
    store(drive, {"P14.03": 7, "P02.06": 55, "P00.11": 3.0})
    report = drive.restore(kept)
    left = {item.code: item.reason for item in report.having("skipped") if item.before != item.wanted}
    assert [item.code for item in report.having("restored")] == ["P00.11"]
    assert left["P14.03"].startswith("serial setting: restored only with serial=True")
    assert left["P02.06"].startswith("motor data: restored only with motor=True")
    assert report.ok
    assert [item.code for item in drive.restore(kept, serial=True).having("restored")] == ["P14.03"]
    assert [item.code for item in drive.restore(kept, motor=True).having("restored")] == ["P02.06"]
    assert not drive.diff(kept)


def test_what_acts_and_what_is_history_is_never_written(virtual: Simulator, drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    text = drive.backup().text().replace("P00.15 = { value = 0, raw = 0 }", "P00.15 = { value = 1, raw = 1 }")
    path.write_text(text.replace("P07.27 = { value = 0, raw = 0 }", "P07.27 = { value = 9, raw = 9 }"))
    assert (Backup.load(path)["P00.15"], Backup.load(path)["P07.27"]) == (1, 9)
    report = drive.restore(path, serial=True, motor=True)
    assert {item.code: item.result for item in report if item.code in ("P00.15", "P07.27")} == {
        "P00.15": "skipped",
        "P07.27": "skipped",
    }
    assert virtual.drive(1).take_writes() == []


def test_groups_are_selected(drive: Drive, store: Store) -> None:
    kept = drive.backup()
    store(drive, OTHER)
    report = drive.restore(kept, groups=["P09", "P00.11"])
    assert {item.code for item in report.having("restored")} == {"P09.01", "P00.11"}
    assert all(item.code.startswith("P09") or item.code == "P00.11" for item in report)
    with pytest.raises(NotAllowed, match='has no group "P77"'):
        drive.restore(kept, groups=["P77"])
    with pytest.raises(NotAllowed, match="not a list"):
        drive.restore(kept, groups="P00")


def test_what_is_beyond_a_limit_that_stays_is_not_sent(virtual: Simulator, drive: Drive, store: Store) -> None:
    store(drive, {"P00.03": 90.0, "P00.04": 80.0})
    kept = drive.backup()
    store(drive, {"P00.04": 50.0, "P00.03": 50.0})
    virtual.drive(1).take_writes()
    report = drive.restore(kept, groups=["P00.04"])
    [item] = report.having("blocked")
    assert (item.code, report.ok) == ("P00.04", False)
    assert item.reason == "it would be beyond P00.03, which the drive has at 50.00 Hz"
    assert virtual.drive(1).take_writes() == []


def test_a_running_drive_is_left_alone(virtual: Simulator, drive: Drive, store: Store) -> None:
    drive.prepare_control()
    kept = drive.backup()
    store(drive, {"P00.03": 60.0})
    drive.run(10.0)
    virtual.drive(1).take_writes()
    with pytest.raises(NotAllowed, match=r"P00.03.* only while the drive is stopped"):
        drive.restore(kept)
    assert virtual.drive(1).take_writes() == []
    assert drive.restore(kept, dry_run=True).having("planned")
    store(drive, {"P00.11": 3.0})
    assert drive.restore(kept, groups=["P00.11"]).ok


def test_a_refusal_ends_nothing_and_is_told(drive: Drive, monkeypatch: pytest.MonkeyPatch, store: Store) -> None:
    kept = drive.backup()
    store(drive, {"P00.11": 3.0, "P00.12": 4.0})
    refuse_writes(monkeypatch, 0x000B)
    report = drive.restore(kept)
    assert {item.code: item.result for item in report if item.result not in ("same", "skipped")} == {
        "P00.11": "refused",
        "P00.12": "restored",
    }
    [item] = report.having("refused")
    assert item.reason.startswith("exception 04H, operation_failed: ")
    assert not report.ok


def test_what_another_hinders_is_tried_again(
    virtual: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch, store: Store
) -> None:
    """A drive that takes P00.11 only after P00.12, which no document says."""
    kept = drive.backup()
    store(drive, {"P00.11": 3.0, "P00.12": 4.0})
    stored(virtual)
    write, seen = Bus.write, []

    def particular(bus: Bus, unit: int, first: int, value: Any, /, **how: Any) -> None:
        seen.append(first)
        write(bus, unit, first, 0xFFFF if first == 0x000B and 0x000C not in seen else value, **how)

    monkeypatch.setattr(Bus, "write", particular)
    report = drive.restore(kept)
    assert (report.ok, report.order) == (True, ("P00.12", "P00.11"))
    assert stored(virtual) == [0x000C, 0x000B]


def test_the_line_is_changed_after_all_else(drive: Drive, monkeypatch: pytest.MonkeyPatch, store: Store) -> None:
    """A drive that obeys its new baud rate at once is not heard any more."""
    store(drive, {"P14.00": 2, "P14.01": 3, "P14.03": 6, "P00.11": 3.0})
    kept = drive.backup()
    store(drive, {"P14.00": 1, "P14.01": 4, "P14.03": 5, "P00.11": 5.0})
    read, write, gone = Bus.read, Bus.write, []

    def obeying(bus: Bus, unit: int, first: int, value: Any, /, **how: Any) -> None:
        write(bus, unit, first, value, **how)
        gone.extend([first] if first == 0x0E01 else [])

    def heard(bus: Bus, unit: int, first: int, count: int = 1, /, **how: Any) -> list[int]:
        if gone:
            raise NoAnswer("silent", unit=unit, started=1.0)
        return read(bus, unit, first, count, **how)

    monkeypatch.setattr(Bus, "write", obeying)
    monkeypatch.setattr(Bus, "read", heard)
    report = drive.restore(kept, serial=True)
    results = {item.code: item.result for item in report if item.code[:3] == "P14" or item.code == "P00.11"}
    assert report.order == ("P00.11", "P14.03")
    assert (results["P00.11"], results["P14.03"]) == ("restored", "restored")
    assert (results["P14.01"], results["P14.00"]) == ("differs", "blocked")


def test_one_the_drive_does_not_have_is_missing(drive: Drive, without: Callable[[int], None]) -> None:
    kept = drive.backup()
    without(0x000C)
    report = drive.restore(kept)
    assert [item.code for item in report.having("missing")] == ["P00.12"]
    assert not report.ok
    [differs] = drive.diff(kept)
    assert (differs.code, differs.left, differs.right) == ("P00.12", 10.0, None)


@pytest.mark.parametrize("differed", [{"P00.11": 3.0, "P00.12": 4.0}, {"P00.12": 4.0}])
def test_one_that_another_changes_is_told(
    drive: Drive, monkeypatch: pytest.MonkeyPatch, store: Store, differed: dict[str, float]
) -> None:
    """A drive that forgets P00.11 when P00.12 is written, whether P00.11 was restored or as in the backup before."""
    kept = drive.backup()
    store(drive, differed)
    write = Bus.write

    def forgetful(bus: Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
        write(bus, unit, address, value, **how)
        if address == 0x000C:
            write(bus, unit, RAM | 0x000B, 77)

    monkeypatch.setattr(Bus, "write", forgetful)
    report = drive.restore(kept)
    [item] = report.having("differs")
    assert (item.code, item.after, report.ok) == ("P00.11", 7.7, False)
    assert "another parameter changed it" in item.reason


@pytest.mark.parametrize("lost", ["request", "answer"])
def test_a_lost_confirmation_is_cleared_up_by_reading(
    virtual: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch, lost: str, store: Store
) -> None:
    kept = drive.backup()
    store(drive, OTHER)
    stored(virtual)
    lose(monkeypatch, lost)
    assert drive.restore(kept).ok
    assert sorted(stored(virtual)) == sorted(drive.profile.address(code) for code in OTHER)


def test_a_silent_drive_ends_it_and_the_rest_follows(virtual: Simulator, drive: Drive, store: Store) -> None:
    kept = drive.backup()
    store(drive, OTHER)
    stored(virtual)
    seen: list[int] = []

    def deaf(done: int, _: int) -> None:
        seen.append(done)
        if done == 3:
            virtual.line.drop_answers(1000)

    with pytest.raises(NoAnswer):
        drive.restore(kept, progress=deaf)
    virtual.line.clear()
    assert drive.restore(kept).ok
    assert sorted(stored(virtual)) == sorted(drive.profile.address(code) for code in OTHER)
    assert not drive.diff(kept)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("identification", "0x01A2", "its identification is 01A2H, not 01A0H"),
        ("firmware", '"1.07"', "its firmware is 1.07, not unknown"),
    ],
)
def test_another_drive_is_given_nothing_unless_forced(
    virtual: Simulator, drive: Drive, tmp_path: Path, field: str, value: str, said: str, store: Store
) -> None:
    path = tmp_path / "drive.toml"
    lines = drive.backup(path).text().splitlines()
    lines = [line for line in lines if not line.startswith((f"{field} =", f"# {field}:"))]
    lines.insert(lines.index("[drive]") + 1, f"{field} = {value}")
    path.write_text("\n".join(lines))
    store(drive, {"P00.11": 3.0})
    stored(virtual)
    for use in (drive.restore, drive.diff):
        with pytest.raises(NotAllowed, match=said):
            use(path)
    assert stored(virtual) == []
    assert [each.code for each in drive.diff(path, force=True)] == ["P00.11"]
    assert drive.restore(path, force=True).ok
    assert stored(virtual) == [0x000B]


def refuse_writes(monkeypatch: pytest.MonkeyPatch, address: int) -> None:
    """A drive that finds every value for *address* wrong."""
    write = Bus.write

    def refusing(bus: Bus, unit: int, first: int, value: Any, /, **how: Any) -> None:
        write(bus, unit, first, 0xFFFF if first == address else value, **how)

    monkeypatch.setattr(Bus, "write", refusing)


def lose(monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    """Of every other write the request or the answer is lost."""
    write = Bus.write
    count = [0]

    def losing(bus: Bus, unit: int, first: int, value: Any, /, **how: Any) -> None:
        count[0] += 1
        if count[0] % 2:
            if what == "answer":
                write(bus, unit, first, value, **how)
            raise NoAnswer("lost", unit=unit, started=1.0)
        write(bus, unit, first, value, **how)

    monkeypatch.setattr(Bus, "write", losing)


@pytest.mark.parametrize(("family", "common"), [("gd300", True), ("vfd500", False)])
def test_another_family_is_given_only_by_force_what_is_the_same_there(
    virtual: Simulator, drive: Drive, store: Store, family: str, common: bool
) -> None:
    """P14.01 is the baud rate of a GD350, and a percentage of a VFD500."""
    store(drive, {"P00.11": 3.0})
    kept = drive.backup()
    with Simulator({1: family}, transport="process", clock="virtual") as others, Bus(others) as bus:
        other = bus.drive(1, family)
        before = others.line.requests
        for use in (other.restore, other.diff):
            with pytest.raises(NotAllowed, match=f"the backup is of a gd350, and unit 1 is a {family}"):
                use(kept)
        assert others.line.requests == before
        report = other.restore(kept, force=True)
        restored = {item.code for item in report.having("restored")}
        assert ("P00.11" in restored, "P14.01" in restored) == (common, False)
        if not common:
            assert others.drive(1).words_written == 0
            missing = {item.code: item.reason for item in report.having("missing")}
            assert (
                missing["P14.01"]
                == "P14.01 is another thing in a Veikong VFD500: A percentage whose name is not printed"
            )
    assert virtual.drive(1).take_writes()[-1][2] == 30


def test_another_family_is_given_what_is_not_verified_there_only_where_that_is_asked(
    drive: Drive, store: Store
) -> None:
    store(drive, {"P00.14": 5.0})
    kept = drive.backup()
    with Simulator({1: "gd300"}, transport="process", clock="virtual") as others, Bus(others) as bus:
        other = bus.drive(1, "gd300")
        report = {item.code: item.result for item in other.restore(kept, force=True)}
        assert report["P00.14"] == "blocked"
        report = {item.code: item.result for item in other.restore(kept, force=True, unverified=True)}
        assert report["P00.14"] == "restored"
