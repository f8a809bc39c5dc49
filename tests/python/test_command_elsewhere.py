"""A family that takes the reset of a fault in a register of its own.

The drive is that of `crates/sim/tests/profiles/acme`, which does not exist. Its reset, 80H at 9000H, is 2 at 9001H.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, Profile, Simulator
from drivebus.cli.present import profile_rules

ACME = Path(__file__).resolve().parents[2] / "crates/sim/tests/profiles/acme"
ORDER, RESET = 0x9000, 0x9001


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    folder = tmp_path / "acme"
    shutil.copytree(ACME, folder)
    manifest = (folder / "profile.toml").read_text(encoding="utf-8")
    for there, instead in (
        ('moves = ["order"]', 'moves = ["order", "alarm_reset"]'),
        ("reset_fault = 0x80\n", '\n[commands.elsewhere]\nreset_fault = { register = "alarm_reset", code = 2 }\n'),
    ):
        assert there in manifest
        manifest = manifest.replace(there, instead)
    (folder / "profile.toml").write_text(manifest, encoding="utf-8")
    with (folder / "registers.csv").open("a", encoding="utf-8") as rows:
        rows.write('0x9001,alarm_reset,Reset of an alarm,,1,no,0,255,,,wo,yes,,"Acme 7 manual, p. 1"\n')
    return Profile.load(folder)


@pytest.fixture
def line(profile: Profile) -> Iterator[Simulator]:
    with Simulator({1: profile}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator, profile: Profile) -> Iterator[Drive]:
    with Bus(line) as bus:
        drive = bus.drive(1, profile, variants={"speed_unit": "Hz"})
        drive.write("speed_unit", 1, store=True)
        drive.prepare_control()
        yield drive


def commanded(line: Simulator) -> list[tuple[int, int]]:
    return [(address, word) for _, address, word in line.drive(1).writes() if address in (ORDER, RESET)]


def test_it_is_reset_there_and_run_and_stopped_where_it_always_was(line: Simulator, drive: Drive) -> None:
    drive.run(hz=20.0)
    line.advance(5.0)
    line.drive(1).trip("OL1")
    drive.reset_fault()
    assert drive.fault() is None
    drive.run(hz=20.0, reverse=True)
    drive.stop()
    assert commanded(line) == [(ORDER, 0x12), (RESET, 2), (ORDER, 0x22), (ORDER, 0x01)]
    frames = [data.hex(" ") for _, who, data in line.line.trace() if who == "master"]
    assert "01 06 90 01 00 02 74 cb" in frames


@pytest.mark.parametrize(
    ("address", "word", "says"),
    [
        (
            RESET,
            1,
            r"1 at 9001H is not a command of unit 1, which is known as Acme Seven: its codes are 2 reset fault;",
        ),
        (ORDER, 0x80, r"128 at 9000H is not a command of unit 1, .* 0 coast, 1 stop, 18 run forward, 34 run reverse,"),
        (ORDER, 2, "2 at 9000H is not a command"),
    ],
)
def test_a_raw_write_is_held_against_the_register_it_goes_to(
    line: Simulator, drive: Drive, address: int, word: int, says: str
) -> None:
    line.drive(1).take_writes()
    with pytest.raises(drivebus.NotAllowed, match=says):
        drive.bus.write(1, address, word)
    with pytest.raises(drivebus.NotAllowed, match=says):
        drive.bus.write(1, address, [word])
    assert line.drive(1).writes() == []
    # The drive itself knows no such code there either.
    with pytest.raises(drivebus.Refused):
        drive.bus.write(1, address, word, force=True)


def test_by_name_it_is_a_command(line: Simulator, drive: Drive) -> None:
    line.drive(1).take_writes()
    with pytest.raises(drivebus.NotAllowed, match="can move the motor"):
        drive.write("alarm_reset", 2)
    assert line.drive(1).writes() == []


def test_the_rules_say_both_places(profile: Profile) -> None:
    assert profile.command_registers() == {
        ORDER: {0: "coast", 1: "stop", 0x12: "run_forward", 0x22: "run_reverse", 64: "beep"},
        RESET: {2: "reset_fault"},
    }
    [lines] = [lines for title, lines in profile_rules.in_words(profile) if title == "Commands"]
    assert lines[-2:] == ["written to 9001H", "  2 reset fault"]
    assert lines[0] == "written to 9000H"
