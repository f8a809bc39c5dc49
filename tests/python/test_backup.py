"""Backup, restore and diff on a simulated line: what is asked, what is written, and what is left alone."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Backup, Bus, Drive, NoAnswer, NotAllowed, Simulator

RAM = 0x8000
OTHER = {"P00.03": 60.0, "P00.04": 55.0, "P00.11": 3.0, "P00.12": 4.0, "P01.20": 1.5, "P09.01": -12.5}
"""Values that are not those of the factory."""


@pytest.fixture
def drive(virtual_bus: Bus) -> Drive:
    return virtual_bus.drive(1, "gd350")


def set_to(drive: Drive, values: dict[str, Any]) -> None:
    """Stores *values*, the higher limit first where it goes up."""
    drive.write(values, store=True)


def stored(simulator: Simulator) -> list[int]:
    """The addresses of EEPROM that were written since it was asked last."""
    return [address for _, address, _ in simulator.drive(1).take_writes() if not address & RAM]


class TestBackup:
    def test_every_parameter_is_read_in_the_fewest_reads(self, virtual: Simulator, drive: Drive) -> None:
        drive.read("P00.01")  # the bus knows the drive
        before = virtual.line.requests
        taken = drive.backup()
        every = [name for name in drive.profile.names() if name.startswith("P")]
        assert {*taken, *taken.unread} == {*every}
        readable = [name for name in every if name != "P07.00"]
        # One more asks who it is.
        assert virtual.line.requests - before == len(drive.profile.compile(readable).reads) + 1
        assert virtual.drive(1).words_written == 0

    def test_progress_counts_to_the_end(self, drive: Drive) -> None:
        seen: list[tuple[int, int]] = []
        taken = drive.backup(progress=lambda done, total: seen.append((done, total)))
        assert seen[0] == (0, len(taken))
        assert seen[-1] == (len(taken), len(taken))
        assert seen == sorted(seen)

    def test_one_that_is_refused_is_named_and_costs_no_other(
        self, drive: Drive, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """A drive whose firmware has no P00.12."""
        refuse(monkeypatch, 0x000C)
        taken = drive.backup()
        assert "exception 02H, illegal_address: there is no such address" in taken.unread["P00.12"]
        assert {*taken.unread} == {"P07.00", "P00.12"}
        assert {"P00.10", "P00.11", "P00.14"} <= {*taken}

    def test_a_locked_drive_ends_it(self, drive: Drive, virtual: Simulator) -> None:
        drive.write("P07.00", 1234, store=True)
        before = virtual.line.requests
        with pytest.raises(drivebus.Refused, match="password"):
            drive.backup()
        assert virtual.line.requests - before <= 2

    @pytest.mark.parametrize("broken_at", [3, 10, 22])
    def test_a_break_costs_nothing_that_was_read(
        self, virtual: Simulator, drive: Drive, tmp_path: Path, broken_at: int
    ) -> None:
        path, part = tmp_path / "drive.toml", tmp_path / "drive.toml.part"
        set_to(drive, OTHER)
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

    def test_a_half_backup_is_neither_restored_nor_compared(self, drive: Drive, tmp_path: Path) -> None:
        path = tmp_path / "drive.toml"
        text = drive.backup(path).text().replace("complete = true", "complete = false")
        path.write_text(text)
        for use in (drive.restore, drive.diff):
            with pytest.raises(NotAllowed, match="never completed"):
                use(path)

    def test_what_another_drive_left_is_not_gone_on_with(self, virtual_bus: Bus, tmp_path: Path) -> None:
        path = tmp_path / "drive.toml"
        part = tmp_path / "drive.toml.part"
        first, second = virtual_bus.drive(1, "gd350"), virtual_bus.drive(2, "gd350")
        part.write_text(first.backup().text().replace("complete = true", "complete = false"))
        with pytest.raises(NotAllowed, match="begun with another drive: its unit is 1, not 2"):
            second.backup(path)
        assert second.backup(path, resume=False).origin.unit == 2

    def test_a_file_of_something_else_is_not_replaced(self, virtual_bus: Bus, tmp_path: Path) -> None:
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


class TestRestore:
    @pytest.mark.parametrize("up", [True, False])
    def test_limits_and_values_come_back(self, virtual: Simulator, drive: Drive, up: bool) -> None:
        """P00.03 is never below P00.04: raised first, lowered last."""
        low, high = {"P00.03": 50.0, "P00.04": 50.0}, {"P00.03": 90.0, "P00.04": 80.0}
        drive.write(high, store=True)
        if not up:
            drive.write({"P00.04": 50.0}, store=True)
            drive.write({"P00.03": 50.0}, store=True)
        now, wanted = (low, high) if not up else (high, low)
        kept = drive.backup()
        drive.write(dict(reversed(wanted.items())) if up else wanted, store=True)
        stored(virtual)
        report = drive.restore(kept)
        assert report.ok
        assert drive.read("P00.03", "P00.04") == now
        # Up: P00.03 at 0003H comes first. Down: P00.04 at 0004H does.
        assert stored(virtual) == ([3, 4] if up else [4, 3])

    def test_only_what_differs_is_written_once_and_to_stay(self, virtual: Simulator, drive: Drive) -> None:
        kept = drive.backup()
        set_to(drive, OTHER)
        stored(virtual)
        assert {each.code for each in drive.diff(kept)} == {*OTHER}
        report = drive.restore(kept)
        assert {item.code for item in report.having("restored")} == {*OTHER}
        assert sorted(stored(virtual)) == sorted(drive.profile.address(code) for code in OTHER)
        virtual.drive(1).power_cycle()
        assert not drive.diff(kept)
        assert drive.restore(kept).having("restored") == []

    def test_what_is_only_in_ram_is_stored_all_the_same(self, virtual: Simulator, drive: Drive) -> None:
        drive.write("P00.11", 3.0, store=True)
        kept = drive.backup()
        drive.write("P00.11", 5.0, store=True)
        drive.write("P00.11", 3.0)
        assert [item.code for item in drive.restore(kept).having("restored")] == ["P00.11"]
        virtual.drive(1).power_cycle()
        assert drive.read("P00.11") == 3.0

    def test_a_dry_run_writes_nothing_and_says_the_same(self, virtual: Simulator, drive: Drive) -> None:
        kept = drive.backup()
        set_to(drive, OTHER)
        stored(virtual)
        plan = drive.restore(kept, dry_run=True)
        assert (virtual.drive(1).take_writes(), plan.dry_run, plan.ok) == ([], True, True)
        report = drive.restore(kept)
        assert plan.order == report.order
        assert [item.code for item in plan.having("planned")] == [item.code for item in report.having("restored")]

    def test_sources_of_commands_come_last(self, drive: Drive) -> None:
        drive.prepare_control(store=True)
        drive.write("P00.11", 3.0, store=True)
        kept = drive.backup()
        drive.write({"P00.01": 0, "P00.06": 0, "P00.11": 5.0}, store=True)
        assert drive.restore(kept).order == ("P00.11", "P00.06", "P00.01")

    def test_serial_settings_and_motor_data_only_where_that_is_asked(self, drive: Drive) -> None:
        kept = drive.backup()
        drive.write({"P14.03": 7, "P02.01": 5.5, "P00.11": 3.0}, store=True)
        report = drive.restore(kept)
        left = {item.code: item.reason for item in report.having("skipped") if item.before != item.wanted}
        assert [item.code for item in report.having("restored")] == ["P00.11"]
        assert left["P14.03"].startswith("a setting of the serial line")
        assert left["P02.01"].startswith("data of the motor")
        assert report.ok
        assert [item.code for item in drive.restore(kept, serial=True).having("restored")] == ["P14.03"]
        assert [item.code for item in drive.restore(kept, motor=True).having("restored")] == ["P02.01"]
        assert not drive.diff(kept)

    def test_what_acts_and_what_is_history_is_never_written(
        self, virtual: Simulator, drive: Drive, tmp_path: Path
    ) -> None:
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

    def test_groups_are_selected(self, drive: Drive) -> None:
        kept = drive.backup()
        set_to(drive, OTHER)
        report = drive.restore(kept, groups=["P09", "P00.11"])
        assert {item.code for item in report.having("restored")} == {"P09.01", "P00.11"}
        assert all(item.code.startswith("P09") or item.code == "P00.11" for item in report)
        with pytest.raises(NotAllowed, match="has no group 'P77'"):
            drive.restore(kept, groups=["P77"])
        with pytest.raises(NotAllowed, match="no list"):
            drive.restore(kept, groups="P00")

    def test_what_is_beyond_a_limit_that_stays_is_not_sent(self, virtual: Simulator, drive: Drive) -> None:
        drive.write({"P00.03": 90.0, "P00.04": 80.0}, store=True)
        kept = drive.backup()
        drive.write({"P00.04": 50.0, "P00.03": 50.0}, store=True)
        virtual.drive(1).take_writes()
        report = drive.restore(kept, groups=["P00.04"])
        [item] = report.having("blocked")
        assert (item.code, report.ok) == ("P00.04", False)
        assert item.reason == "it would be beyond P00.03, which the drive has at 50.00 Hz"
        assert virtual.drive(1).take_writes() == []

    def test_a_running_drive_is_left_alone(self, virtual: Simulator, drive: Drive) -> None:
        drive.prepare_control()
        kept = drive.backup()
        drive.write("P00.03", 60.0, store=True)
        drive.run(10.0)
        virtual.drive(1).take_writes()
        with pytest.raises(NotAllowed, match=r"P00.03.* only while the drive is stopped"):
            drive.restore(kept)
        assert virtual.drive(1).take_writes() == []
        assert drive.restore(kept, dry_run=True).having("planned")
        drive.write("P00.11", 3.0, store=True)
        assert drive.restore(kept, groups=["P00.11"]).ok

    def test_a_refusal_ends_nothing_and_is_told(self, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        kept = drive.backup()
        set_to(drive, {"P00.11": 3.0, "P00.12": 4.0})
        refuse_writes(monkeypatch, 0x000B)
        report = drive.restore(kept)
        assert {item.code: item.result for item in report if item.result not in ("same", "skipped")} == {
            "P00.11": "refused",
            "P00.12": "restored",
        }
        [item] = report.having("refused")
        assert item.reason.startswith("exception 04H, operation_failed: ")
        assert not report.ok

    def test_one_the_drive_does_not_have_is_missing(self, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        kept = drive.backup()
        refuse(monkeypatch, 0x000C)
        report = drive.restore(kept)
        assert [item.code for item in report.having("missing")] == ["P00.12"]
        assert not report.ok
        [differs] = drive.diff(kept)
        assert (differs.code, differs.left, differs.right) == ("P00.12", 10.0, None)

    def test_one_that_another_changes_is_told(self, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        """A drive that forgets P00.11 when P00.12 is written."""
        kept = drive.backup()
        set_to(drive, {"P00.11": 3.0, "P00.12": 4.0})
        write = Bus.write

        def forgetful(bus: Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
            write(bus, unit, address, value, **how)
            if address == 0x000C:
                write(bus, unit, RAM | 0x000B, 77)

        monkeypatch.setattr(Bus, "write", forgetful)
        report = drive.restore(kept)
        [item] = report.having("differs")
        assert (item.code, item.after, report.ok) == ("P00.11", 7.7, False)

    @pytest.mark.parametrize("lost", ["request", "answer"])
    def test_a_lost_confirmation_is_cleared_up_by_reading(
        self, virtual: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch, lost: str
    ) -> None:
        kept = drive.backup()
        set_to(drive, OTHER)
        stored(virtual)
        lose(monkeypatch, lost)
        assert drive.restore(kept).ok
        assert sorted(stored(virtual)) == sorted(drive.profile.address(code) for code in OTHER)

    def test_a_silent_drive_ends_it_and_the_rest_follows(self, virtual: Simulator, drive: Drive) -> None:
        kept = drive.backup()
        set_to(drive, OTHER)
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
        self, virtual: Simulator, drive: Drive, tmp_path: Path, field: str, value: str, said: str
    ) -> None:
        path = tmp_path / "drive.toml"
        lines = drive.backup(path).text().splitlines()
        lines = [line for line in lines if not line.startswith((f"{field} =", f"# {field}:"))]
        lines.insert(lines.index("[drive]") + 1, f"{field} = {value}")
        path.write_text("\n".join(lines))
        drive.write("P00.11", 3.0, store=True)
        stored(virtual)
        for use in (drive.restore, drive.diff):
            with pytest.raises(NotAllowed, match=said):
                use(path)
        assert stored(virtual) == []
        assert [each.code for each in drive.diff(path, force=True)] == ["P00.11"]
        assert drive.restore(path, force=True).ok
        assert stored(virtual) == [0x000B]


def test_the_awaited_drive_does_the_same(tmp_path: Path) -> None:
    async def awaited() -> None:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
            async with drivebus.aio.Bus(simulator) as bus:
                drive = await bus.drive(1)
                kept = await drive.backup(tmp_path / "drive.toml")
                await drive.write("P00.11", 3.0, store=True)
                assert [each.code for each in await drive.diff(kept)] == ["P00.11"]
                assert (await drive.restore(tmp_path / "drive.toml")).ok
                assert not await drive.diff(kept)

    asyncio.run(awaited())


def refuse(monkeypatch: pytest.MonkeyPatch, address: int) -> None:
    """A drive that has nothing at *address*."""
    read = Bus.read

    def refusing(bus: Bus, unit: int, first: int, count: int = 1, /, **how: bool) -> list[int]:
        # 6300H is nowhere: the drive itself refuses.
        return read(bus, unit, 0x6300 if first <= address < first + count else first, count, **how)

    monkeypatch.setattr(Bus, "read", refusing)


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
