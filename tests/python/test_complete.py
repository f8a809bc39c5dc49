"""Complete means complete: what could not be read is counted by its reason. Not there, and closed, are complete."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus import Backup, Bus, Drive, NotAllowed, Simulator
from drivebus.cli import cli
from drivebus.profile.refusals import means

from .kept import Spoilt, Store, stored

P00_12 = 0x000C
NOT_THERE, MALFORMED, FAILED, PASSWORD, DAMAGED, BUSY = 0x02, 0x03, 0x04, 0x05, 0x06, 0x06


@pytest.fixture
def drive(virtual_bus: Bus) -> Drive:
    return virtual_bus.drive(1, "gd350")


@pytest.fixture
def spoil(monkeypatch: pytest.MonkeyPatch, virtual: Simulator) -> Spoilt:
    return Spoilt(monkeypatch, virtual)


REASONS = [
    # what comes, why that is, whether it leaves the backup complete
    (NOT_THERE, "not there", True),
    (PASSWORD, "closed", True),
    (FAILED, "refused", False),
    (MALFORMED, "refused", False),
    (DAMAGED, "lost", False),
    ("silence", "lost", False),
    ("short", "lost", False),
    (0x0B, "lost", False),
]


@pytest.mark.parametrize(("what", "why", "complete"), REASONS)
def test_a_backup_says_why_each_is_not_in_it(
    drive: Drive, spoil: Spoilt, tmp_path: Path, what: int | str, why: str, complete: bool
) -> None:
    whole = drive.backup()
    spoil.read(P00_12, what)
    path, part = tmp_path / "drive.toml", tmp_path / "drive.toml.part"
    taken = drive.backup(path)
    assert {*whole} - {*taken} == {"P00.12"}
    assert (taken.unread["P00.12"].why, taken.complete, taken.interrupted) == (why, complete, False)
    assert taken.unread["P07.00"].why == "not asked"
    # What is not complete never stands where a complete one is looked for.
    assert (path.exists(), part.exists()) == (complete, not complete)
    kept = Backup.load(path if complete else part)
    assert (kept.raw, kept.complete, kept.interrupted) == (taken.raw, complete, False)
    assert (kept.unread["P00.12"], kept.unread["P00.12"].why) == (str(taken.unread["P00.12"]), why)
    assert kept.text().splitlines() == [line for line in taken.text().splitlines() if not line.startswith("# P0")]
    [line] = [line for line in kept.text().splitlines() if line.startswith("P00.12")]
    assert line.startswith(f'P00.12 = {{ unread = "{why}", reason = "')


@pytest.mark.parametrize("what", [DAMAGED, "silence"])
def test_what_passed_was_asked_again_and_is_there(drive: Drive, spoil: Spoilt, what: int | str) -> None:
    whole = drive.backup()
    spoil.read(P00_12, what, times=1)
    taken = drive.backup()
    assert (taken.raw, taken.complete) == (whole.raw, True)


def test_the_next_backup_asks_for_what_was_lost_and_for_nothing_else(
    virtual: Simulator, drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = drive.backup()
    path = tmp_path / "drive.toml"
    with monkeypatch.context() as patch:
        Spoilt(patch, virtual).read(P00_12, DAMAGED)
        drive.backup(path)
    before = virtual.line.requests
    again = drive.backup(path)
    assert (again.raw, again.complete, path.exists(), (tmp_path / "drive.toml.part").exists()) == (
        whole.raw,
        True,
        True,
        False,
    )
    assert virtual.line.requests - before <= 3  # who it is, and the one


def test_a_complete_file_is_not_replaced_by_one_that_is_not(drive: Drive, spoil: Spoilt, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    drive.backup(path)
    kept = path.read_text()
    spoil.read(P00_12, FAILED)
    assert not drive.backup(path).complete
    assert path.read_text() == kept


def test_a_line_that_is_dead_ends_it_as_ever(virtual: Simulator, drive: Drive, tmp_path: Path) -> None:
    drive.backup()

    def progress(done: int, _total: int) -> None:
        if done > 10:
            virtual.line.set_faults(silence=1.0)

    with pytest.raises(drivebus.NoAnswer):
        drive.backup(tmp_path / "drive.toml", progress=progress)
    assert Backup.load(tmp_path / "drive.toml.part").interrupted


def test_old_files_load(drive: Drive, tmp_path: Path) -> None:
    path = tmp_path / "old.toml"
    path.write_text('format = 1\ncomplete = true\n[drive]\nfamily = "gd350"\n[parameters]\nP00.12 = { value = 4.0 }\n')
    assert (Backup.load(path).complete, Backup.load(path).unread) == (True, {})
    path.write_text(path.read_text().replace("true", "false"))
    assert Backup.load(path).interrupted
    with pytest.raises(NotAllowed, match="never completed"):
        drive.diff(path)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ('unread = "gone", reason = "x"', "not there, closed, refused, lost"),
        ('unread = "lost"', "reason"),
        ('unread = "lost", reason = "x", value = 1', "value"),
        ('unread = 3, reason = "x"', "not there, closed, refused, lost"),
    ],
)
def test_a_line_that_says_why_is_checked(tmp_path: Path, fields: str, said: str) -> None:
    path = tmp_path / "drive.toml"
    path.write_text(f'format = 1\n[drive]\nfamily = "gd350"\n[parameters]\nP00.12 = {{ {fields} }}\n')
    with pytest.raises(NotAllowed, match=rf"drive\.toml:5: P00\.12.*{said}"):
        Backup.load(path)


@pytest.mark.parametrize(("what", "why", "complete"), REASONS)
def test_a_diff_says_what_it_could_not_compare(
    drive: Drive, spoil: Spoilt, what: int | str, why: str, complete: bool
) -> None:
    kept = drive.backup()
    spoil.read(P00_12, what)
    found = drive.diff(kept)
    if why == "not there":
        assert [each.code for each in found] == ["P00.12"]
        return
    assert [*found] == []
    assert found.uncompared["P00.12"].why == why  # type: ignore[attr-defined]
    # Who asks `if drive.diff(…)` is not told that all is as it was.
    assert (found.complete, bool(found)) == (complete, not complete)


def test_a_backup_that_lacks_some_is_compared_and_says_so(drive: Drive, spoil: Spoilt) -> None:
    spoil.read(P00_12, FAILED)
    taken = drive.backup()
    for found in (drive.diff(taken), taken.diff(taken)):
        assert (len(found), found.complete, "P00.12" in found.uncompared) == (0, False, True)


@pytest.mark.parametrize(("what", "why"), [(each[0], each[1]) for each in REASONS])
def test_a_restore_names_no_cause_that_was_none(
    virtual: Simulator, drive: Drive, spoil: Spoilt, store: Store, what: int | str, why: str
) -> None:
    """What it has of P00.12 cannot be read: then it is not written, and the reason is the line's or the drive's own."""
    kept = drive.backup()
    store(drive, {"P00.11": 3.0, "P00.12": 4.0})
    stored(virtual)
    spoil.read(P00_12, what)
    report = drive.restore(kept)
    [item] = [item for item in report if item.code == "P00.12"]
    assert [done.code for done in report.having("restored")] == ["P00.11"]
    assert stored(virtual) == [0x000B]
    assert (item.result, item.failed, report.ok) == ("missing" if why == "not there" else "unread", True, False)
    assert why == "not there" or f"{why}: " in item.reason
    assert why == "not there" or "not written" in item.reason


def test_a_restore_does_not_blame_another_parameter_for_a_lost_look(
    virtual: Simulator, drive: Drive, spoil: Spoilt, store: Store
) -> None:
    """It was written and read back; the look at the end, whether another parameter moved it, is lost."""
    kept = drive.backup()
    store(drive, {"P00.11": 3.0})
    reads = virtual.line.requests

    def progress(done: int, _total: int) -> None:
        assert virtual.line.requests > reads
        if done:
            spoil.read(0x000B, DAMAGED)

    report = drive.restore(kept, progress=progress)
    [item] = [item for item in report if item.code == "P00.11"]
    assert item.result == "unread"
    assert "another parameter" not in item.reason
    assert "was written and read back" in item.reason
    assert drive.profile.encode("P00.11", 10.0) == virtual.drive(1).register(0x000B)


@pytest.mark.parametrize(("what", "said"), [(DAMAGED, "frame_error"), (FAILED, "operation_failed")])
def test_a_write_that_is_refused_says_whether_the_drive_took_it(
    virtual: Simulator,
    drive: Drive,
    store: Store,
    monkeypatch: pytest.MonkeyPatch,
    what: int,
    said: str,
) -> None:
    """A drive that refuses takes nothing: the request goes where it has no such parameter, and comes back refused."""
    kept = drive.backup()
    store(drive, {"P00.11": 3.0, "P00.12": 4.0})
    stored(virtual)
    write, asked = Bus.write, [0]

    def refusing(bus: Bus, unit: int, first: int, value: object, /, **options: object) -> None:
        if first != P00_12:
            return write(bus, unit, first, value, **options)  # type: ignore[arg-type]
        asked[0] += 1
        raise drivebus.Refused("refused", code=what, unit=unit)

    monkeypatch.setattr(Bus, "write", refusing)
    report = drive.restore(kept)
    [item] = report.having("refused")
    assert (item.code, said in item.reason, "the drive did not take it" in item.reason) == ("P00.12", True, True)
    assert [done.code for done in report.having("restored")] == ["P00.11"]
    # Once more after the others, as ever; and once more again what passes.
    assert asked[0] == (3 if what == DAMAGED else 2)


def test_a_write_that_was_taken_is_looked_at_and_never_sent_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The documents of an ATV312 print no exceptions: 05H is the specification's, "taken"."""
    with Simulator({1: "atv312"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
        drive = bus.drive(1, "atv312", unverified=True)
        kept = drive.backup()
        drive.write("ACC", 5.0, store=True)
        simulator.drive(1).take_writes()
        write = Bus.write

        def acknowledged(bus: Bus, unit: int, first: int, value: int, /, **options: Any) -> None:
            write(bus, unit, first, value, **options)
            raise drivebus.Refused("acknowledged", code=5, unit=unit)

        monkeypatch.setattr(Bus, "write", acknowledged)
        report = drive.restore(kept)
        assert [item.code for item in report.having("restored")] == ["ACC"]
        # ACC is at 9001, and CMI, which stores it, at 8504.
        assert [place for _, place, _ in simulator.drive(1).take_writes()] == [9001, 8504]
        assert report.ok


INVT = {1: "", 2: "no_such", 3: "", 4: "", 5: "not_now", 6: "ask_again", 7: "", 8: "not_now", 9: "not_now"}


@pytest.mark.parametrize(
    ("family", "meant"),
    [
        ("gd350", {**INVT, 10: "ask_again", 11: "ask_again"}),
        ("gd20", INVT),
        # It prints none: the specification's own.
        ("atv312", {1: "", 2: "no_such", 3: "", 4: "", 5: "taken", 6: "ask_again", 10: "ask_again", 11: "ask_again"}),
        ("a1000", {1: "", 2: "no_such", 5: "taken", 6: "ask_again", 0x21: "", 0x22: "", 0x24: "ask_again"}),
        ("eds300", {1: "ask_again", 2: "", 3: "no_such", 4: "", 5: "", 6: ""}),
        ("vfd500", {1: "", 2: "no_such", 3: "ask_again", 4: "", 5: "not_now", 6: "ask_again"}),
    ],
)
def test_a_code_says_another_thing_in_the_next_family(family: str, meant: dict[int, str]) -> None:
    profile = drivebus.Profile.builtin(family)
    assert {code: means(profile, code) for code in meant} == meant


class TestDiscovery:
    """Numbers of group P05, some of which answer strangely."""

    CODE = "P05.03"
    ADDRESS = 0x0503

    @pytest.mark.parametrize(("what", "why"), [(each[0], each[1]) for each in REASONS])
    def test_only_what_was_answered_or_is_closed_is_there(
        self, drive: Drive, spoil: Spoilt, tmp_path: Path, what: int | str, why: str
    ) -> None:
        spoil.read(self.ADDRESS, what)
        found = drive.discover(tmp_path / "mine", groups=["P05"])
        assert self.CODE not in found.words
        assert (self.CODE in found.refused) == (why == "closed")
        settled = why in ("not there", "closed")
        assert {code: why.why for code, why in found.unsettled.items()} == ({} if settled else {self.CODE: why})
        assert found.complete == settled
        assert (tmp_path / "mine").exists()
        assert (tmp_path / "mine.part").exists() != settled

    def test_going_on_asks_for_what_is_not_settled(
        self, virtual: Simulator, drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        whole = drive.discover(groups=["P05"])
        with monkeypatch.context() as patch:
            Spoilt(patch, virtual).read(self.ADDRESS, DAMAGED)
            drive.discover(tmp_path / "mine", groups=["P05"])
        before = virtual.line.requests
        again = drive.discover(tmp_path / "mine", groups=["P05"])
        assert (again.words, again.complete) == (whole.words, True)
        assert virtual.line.requests - before <= 3
        assert not (tmp_path / "mine.part").exists()
        assert self.CODE in (tmp_path / "mine" / "parameters.csv").read_text()

    def test_what_was_edited_meanwhile_stays(self, drive: Drive, spoil: Spoilt, tmp_path: Path) -> None:
        spoil.read(self.ADDRESS, DAMAGED)
        drive.discover(tmp_path / "mine", groups=["P05"])
        table = tmp_path / "mine" / "parameters.csv"
        table.write_text(table.read_text().replace("Not known; the drive has it", "Mine", 1))
        with pytest.raises(NotAllowed, match="is there already"):
            drive.discover(tmp_path / "mine", groups=["P05"])
        assert "Mine" in table.read_text()

    def test_a_damaged_request_is_no_proof_that_it_refuses(self, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        """A unit that answers everything; the three numbers that cannot be are refused with 06H."""
        read = Bus.read

        def answering(bus: Bus, unit: int, first: int, count: int = 1, /, **options: object) -> list[int]:
            if first & 0xFF == 0xFF:
                raise drivebus.Refused("refused", code=DAMAGED, unit=unit)
            return read(bus, unit, first, count, **options) if first >= 0x2000 else [7] * count  # type: ignore[arg-type]

        monkeypatch.setattr(Bus, "read", answering)
        with pytest.raises(drivebus.Refused, match="frame_error"):
            drive.discover(groups=["P05"])


class TestCommands:
    """What they print, and what they exit with."""

    @pytest.fixture
    def simulator(self) -> Iterator[Simulator]:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
            yield simulator

    @pytest.fixture
    def spoilt(self, simulator: Simulator, monkeypatch: pytest.MonkeyPatch) -> Spoilt:
        """The line of the commands is that simulator's."""
        bus = drivebus.Bus
        monkeypatch.setattr(drivebus, "Bus", lambda *_, **__: bus(simulator))
        return Spoilt(monkeypatch, simulator)

    def run(self, *words: object) -> Result:
        return CliRunner().invoke(cli, ["--port", "sim://gd350", *map(str, words)], prog_name="drivebus")

    @pytest.mark.parametrize(("what", "why", "complete"), REASONS)
    def test_backup(self, spoilt: Spoilt, tmp_path: Path, what: int | str, why: str, complete: bool) -> None:
        file = tmp_path / "drive.toml"
        spoilt.read(P00_12, what)
        done = self.run("backup", file)
        assert done.exit_code == (0 if complete else 1), done.output
        assert f"1 {why}" in done.stdout
        assert ("not complete" in done.stderr) == (not complete)
        assert (f"{file}.part" in done.stdout) == (not complete)
        told = json.loads(self.run("--json", "backup", file, "--fresh", "--force").stdout)
        assert (told["complete"], told["counts"]) == (complete, {"not asked": 2, why: 1})
        assert told["file"] == (str(file) if complete else f"{file}.part")

    @pytest.mark.parametrize(("what", "why", "complete"), REASONS[1:])
    def test_diff(self, spoilt: Spoilt, tmp_path: Path, what: int | str, why: str, complete: bool) -> None:
        file = tmp_path / "drive.toml"
        assert self.run("backup", file).exit_code == 0
        assert self.run("diff", file).exit_code == 0
        spoilt.read(P00_12, what)
        done = self.run("diff", file)
        assert done.exit_code == (0 if complete else 1), done.output
        assert f"1 {why}" in done.stdout
        assert ("P00.12" in done.stdout) == (not complete)
        told = [json.loads(line) for line in self.run("--json", "diff", file).stdout.splitlines()]
        assert [(each["code"], each["not_compared"]) for each in told] == ([] if complete else [("P00.12", why)])

    @pytest.mark.parametrize(("what", "why", "complete"), REASONS)
    def test_discover(self, spoilt: Spoilt, tmp_path: Path, what: int | str, why: str, complete: bool) -> None:
        folder = tmp_path / "mine"
        spoilt.read(0x0503, what)
        done = self.run("discover", folder, "--group", "P05")
        assert done.exit_code == (0 if complete else 1), done.output
        assert ("P05.03" in done.stdout) == (why != "not there")
        assert ("Not settled" in done.stdout) == (not complete)
        told = json.loads(self.run("--json", "discover", tmp_path / "other", "--group", "P05").stdout)
        assert [*told["unsettled"]] == ([] if complete else ["P05.03"])
        assert told["complete"] == complete

    def test_restore(self, spoilt: Spoilt, tmp_path: Path) -> None:
        file = tmp_path / "drive.toml"
        assert self.run("backup", file).exit_code == 0
        spoilt.read(P00_12, DAMAGED)
        done = self.run("restore", file, "--yes")
        assert done.exit_code == 1
        assert "unread" in done.stdout
        assert "frame_error" in done.stdout
