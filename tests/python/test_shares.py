"""A drive that counts shares of a range, puts the high word first, and takes commands where it tells its state.

The drive is that of `crates/sim/tests/profiles/share`, which does not exist: 16384 counts are what S-3 says, 60 Hz from
the factory; S-5 counts 16384 for 100 %. Words and values are worked out by hand.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner
from tests.python.conftest import NO_PTY
from tests.python.test_broken_profiles import change

import drivebus
from drivebus import Bus, Drive, Profile, Simulator, State, rtu, trial
from drivebus.cli import cli
from drivebus.line.meaning import meaning

SHARE = Path(__file__).resolve().parents[2] / "crates/sim/tests/profiles/share"
STATUS, SPEED, TORQUE = 0x0008, 0x0009, 0x0106


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: SHARE}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, profile=SHARE)
        drive.prepare_control(store=True)
        yield drive


def sent(line: Simulator) -> list[str]:
    return [data[:-2].hex(" ").upper() for _, who, data in line.line.trace() if who == "master"]


def test_a_whole_job_in_hertz(line: Simulator, drive: Drive) -> None:
    # 10 Hz of 60 Hz are 2730.67 counts of 16384; command and speed stand side by side, and so go out together.
    drive.run(hz=10.0)
    assert "01 10 00 08 00 02 04 00 02 0A AB" in sent(line)
    assert drive.setpoint == 10.001  # 2731 / 16384 of 60 is 10.00122
    line.advance(5.0)
    assert (drive.state(), drive.read("hertz")) == (State.FORWARD, 10.0)
    drive.setpoint = 30
    assert line.drive(1).register(SPEED) == 8192
    drive.stop()
    line.advance(5.0)
    assert (drive.state(), line.drive(1).state) == (State.STOPPED, "stopped")


def test_too_fine_and_too_much_are_refused_before_anything_is_sent(drive: Drive) -> None:
    for hz, said in (
        (10.0001, "the nearest allowed are 9.998 and 10.001 Hz"),
        (60.5, "allowed is 0.000 to 60.000 Hz"),
    ):
        with pytest.raises(drivebus.NotAllowed, match=said):
            drive.run(hz=hz)
    assert drive.state() is State.STOPPED


def test_the_parameter_of_the_drive_decides_what_a_count_is(line: Simulator, drive: Drive) -> None:
    assert drive.describe("speed").unit == "raw"
    drive.setpoint = 60
    assert line.drive(1).register(SPEED) == 16384
    profile = Profile.load(SHARE)
    assert profile.with_variants({"base_frequency": "50 Hz"}).encode("speed", 50) == 16384
    known = profile.with_variants({"base_frequency": "50 Hz"}).describe("speed")
    assert (known.scale, known.unit, known.high, known.text(10.001)) == (327.68, "Hz", 50.0, "10.001")


def test_scales_words_and_texts_of_a_share(line: Simulator, drive: Drive) -> None:
    known = drive.describe("S-5")
    assert (known.scale, known.default, known.low, known.text(33.331)) == (163.84, 25.0, -100.0, "33.331")
    drive.write("S-5", 33.333, store=True)
    assert (line.drive(1).register(TORQUE), drive.read("S-5")) == (5461, 33.331)  # 5461 / 163.84 = 33.3313
    drive.write("S-5", -100, store=True)
    assert (line.drive(1).register(TORQUE), drive.read("S-5")) == (0xC000, -100.0)
    assert drive.describe("reference").high_first
    assert not drive.describe("bus_voltage").high_first
    assert drive.read("reference") == 60.0
    assert drive.profile.decode("reference", 0x0001_86A0) == 100.0
    # The simulated high words are 0: with the order mistaken these would be thousands.
    assert 0 < drive.read("bus_voltage") < 1000
    assert 0 <= drive.read("output_current") < 30


def test_a_backup_of_shares_goes_around(line: Simulator, drive: Drive, tmp_path: Path) -> None:
    drive.write("S-5", 33.333, store=True)
    kept = tmp_path / "share.toml"
    drive.backup().save(kept)
    lines = kept.read_text(encoding="utf-8").splitlines()
    assert 'S-5 = { value = 33.331, unit = "%", raw = 5461 }  # Torque limit' in lines
    taken = drivebus.Backup.load(kept, Profile.load(SHARE))
    assert (taken.raw["S-5"], taken.raw["S-3"]) == (5461, 60000)
    drive.write("S-5", 12, store=True)
    assert [difference.code for difference in drive.diff(taken)] == ["S-5"]
    drive.restore(taken)
    assert line.drive(1).register(TORQUE) == 5461


def test_a_sine_falls_on_what_the_drive_counts(drive: Drive) -> None:
    measured = trial.sine(drive, 10, 20, period=4, duration=16, max_current=40)
    assert measured.aborted is None


def test_a_command_is_no_state_in_a_trace(drive: Drive) -> None:
    profile = drive.profile
    write, read = rtu.encode_write(1, STATUS, 2), rtu.encode_read(1, STATUS, 1)
    told = bytes.fromhex("01 03 02 00 03")
    answer = told + drivebus.crc16(told).to_bytes(2, "little")
    assert meaning(write, True, profile=profile) == "unit 1: write order = 2 (run forward)"
    assert meaning(write, False, write, profile) == "unit 1 took order = 2 (run forward)"
    assert meaning(read, True, profile=profile) == "unit 1: read status (0008H)"
    assert meaning(answer, False, read, profile) == "unit 1 answers status = 0003H"
    assert (profile.name_at(STATUS), profile.name_at(STATUS, written=True)) == ("status", "order")


def test_a_raw_write_is_judged_as_a_command(drive: Drive) -> None:
    with pytest.raises(drivebus.NotAllowed, match="3 at 0008H is not a command"):
        drive.write_words(STATUS, 3)
    with pytest.raises(drivebus.NotAllowed):
        drive.write("order", 2)


def test_the_whole_may_be_any_value_of_the_parameter(tmp_path: Path) -> None:
    """The same drive, whose S-4 is the whole, whatever it is."""
    folder = tmp_path / "any"
    shutil.copytree(SHARE, folder)
    file = folder / "profile.toml"
    text = file.read_text().replace('parameter = "S-3"', 'parameter = "S-4"')
    before, table, rest = text.partition("[variants.base_frequency.choices]\n")
    rest = rest[rest.index("\n[") :]
    assert table
    file.write_text(f"{before}[variants.base_frequency.share]\ncounts = 16384\nlow = 1.0\nhigh = 100.0\n{rest}")
    with Simulator({1: folder}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, profile=folder)
        drive.prepare_control(store=True)
        # 16384 of 47.5 Hz: 10 Hz are 3449.3; of 60 Hz 2730.7.
        for whole, counts in ((47.5, 3449), (60.0, 2731)):
            drive.write("S-4", whole, store=True)
            drive.run(hz=10.0)
            assert line.drive(1).register(SPEED) == counts
            line.advance(5.0)
            assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)
            drive.stop()
            drive.wait_until_stopped(timeout=20)


def changed(folder: Path, **replaced: tuple[str, str]) -> Path:
    """The profile in *folder*, with one text replaced by another in each file."""
    shutil.copytree(SHARE, folder)
    for name, (what, by) in replaced.items():
        change(next(folder.glob(f"{name}.*")), what, by)
    return folder


def test_a_profile_that_tells_no_state_runs_where_nothing_else_fits(line: Simulator, tmp_path: Path) -> None:
    """Nothing that such a unit answers shows it to be what it was named as, and all others are ruled out."""
    text = (SHARE / "profile.toml").read_text()
    state = text[text.index("[state]") : text.index("[bits]")]
    folder = changed(tmp_path / "stateless", profile=(state, ""))
    with Bus(line) as bus:
        drive = bus.drive(1, profile=folder)
        drive.prepare_control(store=True)
        drive.run(hz=10.0)
        line.advance(5.0)
        assert line.drive(1).state == "forward"
        drive.stop()
        line.advance(5.0)
        assert line.drive(1).state == "stopped"


def test_what_a_profile_lacks_to_run_a_motor_is_noted_and_no_mistake(tmp_path: Path) -> None:
    text = (SHARE / "profile.toml").read_text()
    state = text[text.index("[state]") : text.index("[bits]")]
    done = CliRunner().invoke(cli, ["profiles", "check", str(changed(tmp_path / "less", profile=(state, "")))])
    assert (done.exit_code, "is sound" in done.stdout) == (0, True)
    assert done.stderr == "Note: [state] is missing: a start and a stop are proved by nothing it shows.\n"
    assert CliRunner().invoke(cli, ["profiles", "check", str(SHARE)]).stderr == ""


@NO_PTY
def test_who_waits_and_cannot_look_is_told_that_the_motor_may_turn(tmp_path: Path) -> None:
    folder = changed(tmp_path / "elsewhere", registers=("0x0010,hertz", "0x0019,hertz"))
    with Simulator({1: SHARE}, transport="pty") as line:
        words = ["--port", line.port, "--profile", str(folder)]
        assert CliRunner().invoke(cli, [*words, "prepare", "--store", "--yes"]).exit_code == 0
        done = CliRunner().invoke(cli, [*words, "run", "10", "--yes", "--wait", "5"])
        assert done.exit_code == 7
        said = " ".join(done.stderr.split())
        assert "unit 1 took the start, and what it does could not be looked at: unit 1 refused to read" in said
        assert "0019H" in said
        assert "The motor may turn; `drivebus" in said
        assert line.drive(1).state == "forward"
        CliRunner().invoke(cli, [*words, "stop"])
        assert line.drive(1).state == "stopped" or line.drive(1).writes()[-1][1:] == (0x0008, 0)


def test_each_row_is_read_once_and_what_the_drive_refuses_is_named(tmp_path: Path) -> None:
    """The simulated drive knows 0010H; a profile that is one off is told so, and nothing is written."""
    folder = changed(tmp_path / "off", registers=("0x0010,hertz", "0x0019,hertz"))
    with Simulator({1: SHARE}, transport="pty") as line:
        words = ["--json", "--port", line.port, "profiles", "check", "--read"]
        done = CliRunner().invoke(cli, [*words, str(SHARE)])
        assert done.exit_code == 0, done.output
        told = {row["name"]: row for row in map(json.loads, done.stdout.splitlines()) if "place" in row}
        profile = drivebus.Profile.load(SHARE)
        readable = [name for name in profile.names() if profile.describe(name).access != "wo"]
        assert len(told) == len(readable) > 4
        assert (told["hertz"]["place"], float(told["hertz"]["value"])) == ("0010H", 0.0)

        done = CliRunner().invoke(cli, [*words, str(folder)])
        assert (done.exit_code, "unit 1 refuses hertz: " in done.stderr) == (4, True), done.output
        assert not line.drive(1).writes()
