"""Commands for several drives at once, by name, by group and by address: each by itself, and all of them told."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

SITE = """
[lines.hall]
port = "sim://1=gd350,2=gd350,3=vfd500?clock=virtual"

[drives]
pump1 = {{ line = "hall", unit = 1 }}
pump2 = {{ line = "hall", unit = 2 }}
mixer = {{ line = "hall", unit = 3, profile = "vfd500", read_only = true }}
gone = {{ line = "hall", unit = 9, profile = "gd350" }}

[groups]
pumps = ["pump1", "pump2"]
all = ["pump1", "gone", "pump2"]
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a `drivebus.toml`."""
    (tmp_path / "drivebus.toml").write_text(SITE.format())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    return tmp_path


@pytest.fixture
def line(monkeypatch: pytest.MonkeyPatch) -> Iterator[drivebus.Simulator]:
    """The line of all ports: two quick drives that obey the bus, and a third."""
    opened = drivebus.Bus

    def open_it(_port: str, **how: object) -> drivebus.Bus:
        return opened(simulator, **{name: how[name] for name in ("read_only",)})  # type: ignore[arg-type]  # as it was given

    units = {1: "gd350", 2: "gd350", 3: "vfd500"}
    with drivebus.Simulator(units, transport="process", clock="virtual") as simulator:
        with opened(simulator) as bus:
            for unit in (1, 2):
                bus.drive(unit).prepare_control()
                bus.drive(unit).write({"P00.11": 1.0, "P00.12": 1.0})
        monkeypatch.setattr(drivebus, "Bus", open_it)
        yield simulator


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, list(words))


def records(result: Result) -> list[dict[str, object]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


@pytest.mark.usefixtures("line")
def test_each_drive_answers_under_its_name() -> None:
    told = records(run("-d", "pumps", "--json", "status"))
    assert [(each["drive"], each["state"]) for each in told] == [("pump1", "stopped"), ("pump2", "stopped")]
    told = records(run("--port", "hall", "-u", "1-2", "--json", "read", "P00.11"))
    assert [(each["drive"], each["value"]) for each in told] == [("unit 1", 1.0), ("unit 2", 1.0)]
    shown = run("status", "-d", "pump2", "-d", "pump1").stdout
    assert re.findall(r"^(pump\d): stopped, 0\.00 of .* Hz.* V", shown, re.MULTILINE) == ["pump2", "pump1"], (
        "a line each"
    )


@pytest.mark.usefixtures("line")
def test_one_drive_of_the_file_is_shown_as_any() -> None:
    [told] = records(run("-d", "pump1", "--json", "status"))
    assert "drive" not in told
    assert told["state"] == "stopped"
    assert run("-d", "pump1", "stop").stdout.startswith("pump1: stopped")


def test_motors_start_and_stop_side_by_side(line: drivebus.Simulator) -> None:
    started = run("-d", "pumps", "run", "10", "--yes", "--wait", "30")
    assert started.exit_code == 0, started.stderr
    assert [line.drive(unit).frequency for unit in (1, 2)] == [10.0, 10.0]
    assert re.findall(r"^(pump\d): forward", started.stdout, re.MULTILINE) == ["pump1", "pump2"]
    before = len(line.line.trace())
    assert run("-d", "pumps", "stop").exit_code == 0
    assert {line.drive(unit).state for unit in (1, 2)} == {"stopped"} or line.drive(1).frequency < 10.0
    sent = [data for _, side, data in line.line.trace()[before:] if side == "master" and data[1] == 0x06]
    assert sorted(sent) == [drivebus.rtu.encode_write(unit, 0x2000, 5) for unit in (1, 2)], "each once"


@pytest.mark.usefixtures("line")
def test_who_failed_is_said_and_the_others_are_done() -> None:
    ended = run("-d", "all", "read", "P00.11")
    assert ended.exit_code == 3
    assert "gone: Error: " in ended.stderr
    assert "1 of 3 failed: gone" in ended.stderr
    assert ended.stdout.count("Acceleration time 1") == 2
    ended = run("-d", "all", "--json", "read", "P00.11")
    assert [(each["drive"], each["value"]) for each in records(ended)] == [
        ("pump1", 1.0),
        ("gone", None),
        ("pump2", 1.0),
    ]


def test_nothing_is_asked_before_all_may_go_on(line: drivebus.Simulator) -> None:
    line.drive(1).take_writes()
    refused = run("-d", "all", "run", "10")
    assert refused.exit_code == 2
    assert "pump1: unit 1 on sim://" in refused.stderr
    assert "pump2: unit 2 on sim://" in refused.stderr
    assert "without a terminal this needs --yes" in refused.stderr
    assert not line.drive(1).take_writes()
    assert not line.drive(2).frequency


def test_read_only_is_of_each_drive(line: drivebus.Simulator) -> None:
    ended = run("-d", "mixer", "-d", "pump1", "stop")
    assert ended.exit_code == 2
    assert "mixer: Error: `stop` writes to the drive, and --read-only says that nothing may" in ended.stderr
    assert line.drive(3).words_written == 0
    assert ended.stdout.startswith("pump1: stopped")


@pytest.mark.usefixtures("line")
def test_a_command_for_one_drive_says_so() -> None:
    ended = run("-d", "pumps", "discover", "x")
    assert ended.exit_code == 2
    assert ended.stderr == "Error: `discover` takes one drive at a time, and these are named: pump1, pump2\n"
    assert not Path("x").exists()


@pytest.mark.usefixtures("line")
def test_backups_of_several_drives_are_files_of_a_folder() -> None:
    ended = run("-d", "pumps", "backup", "x.toml")
    assert (ended.exit_code, ended.stderr) == (
        2,
        "Error: several drives have a file each: give a folder for them, such as x\n",
    )
    assert not Path("x.toml").exists()
    assert run("-d", "pumps", "backup", "x").exit_code == 0
    assert [drivebus.Backup.load(f"x/pump{unit}.toml").origin.unit for unit in (1, 2)] == [1, 2]


@pytest.mark.parametrize("option", ["--port x", "--unit 2", "--baud 9600", "--format 8N1", "--rs485 rts"])
def test_where_a_drive_is_is_said_once(option: str) -> None:
    ended = run("-d", "pump1", *option.split(), "status")
    assert ended.exit_code == 2
    assert f"leave {option.split()[0]} out" in ended.stderr


def test_the_environment_gives_way_to_a_name(line: drivebus.Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRIVEBUS_PORT", "/dev/nowhere")
    monkeypatch.setenv("DRIVEBUS_UNIT", "9")
    assert run("-d", "pump2", "coast").exit_code == 0
    assert line.drive(2).words_written


def test_names_are_looked_for_here_then_among_the_settings(folder: Path) -> None:
    here = folder / "drivebus.toml"
    settings = folder / "config" / "drivebus" / "drivebus.toml"
    settings.parent.mkdir(parents=True)
    settings.write_text(SITE.format().replace("mixer", "stirrer"))
    assert "mixer" in run("drives").stdout
    here.rename(folder / "other.toml")
    assert "stirrer" in run("drives").stdout
    assert "mixer" in run("--config", "other.toml", "drives").stdout
    settings.unlink()
    missing = run("-d", "pump1", "status")
    assert missing.exit_code == 2
    assert "there is neither drivebus.toml in this folder nor " in missing.stderr
    assert run("--config", "none.toml", "drives").exit_code == 2


def test_drives_lists_them_with_their_groups() -> None:
    told = records(run("--json", "drives"))
    assert told[0] == {
        "drive": "pump1",
        "line": "hall",
        "port": "sim://1=gd350,2=gd350,3=vfd500?clock=virtual",
        "unit": 1,
        "profile": None,
        "groups": "pumps, all",
    }
    assert [each["drive"] for each in told] == ["pump1", "pump2", "mixer", "gone"]


def test_a_mistake_in_the_file_is_told_with_its_line(folder: Path) -> None:
    (folder / "drivebus.toml").write_text('[lines.hall]\nport = "x"\nbaud = "fast"\n')
    ended = run("-d", "pump1", "status")
    assert ended.exit_code == 2
    assert 'drivebus.toml:3: baud = "fast": not a whole number from 1 to 100000000' in ended.stderr


def test_without_names_the_file_is_not_looked_at(folder: Path) -> None:
    (folder / "drivebus.toml").write_text("no toml")
    assert run("--port", "sim://gd350?clock=virtual", "status").exit_code == 0
    assert run("--port", "hall", "status").exit_code == 2


def test_names_are_completed(folder: Path) -> None:
    environment = {
        **os.environ,
        "_DRIVEBUS_COMPLETE": "bash_complete",
        "COMP_WORDS": "drivebus -d pu",
        "COMP_CWORD": "2",
    }
    done = subprocess.run(
        [sys.executable, "-m", "drivebus"], env=environment, capture_output=True, text=True, check=False, cwd=folder
    )
    assert done.stdout.split() == ["plain,pump1", "plain,pump2", "plain,pumps"]


@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_one_question_for_all_and_no_means_none(folder: Path) -> None:
    units = {1: "gd350", 2: "gd350"}
    with drivebus.Simulator(units, transport="pty") as simulator:
        with drivebus.Bus(simulator) as bus:
            for unit in units:
                bus.drive(unit).prepare_control()
        for unit in units:
            simulator.drive(unit).take_writes()
        words = [sys.executable, "-m", "drivebus", "--port", simulator.port, "-u", "1-2", "run", "10"]
        leader, follower = pty.openpty()
        with subprocess.Popen(words, stdin=follower, stdout=follower, stderr=follower, cwd=folder) as program:
            os.close(follower)
            said = b""
            while b"Go ahead?" not in said:
                said += os.read(leader, 1000)
            os.write(leader, b"n\n")
            while b"Cancelled" not in said:
                said += os.read(leader, 1000)
            assert program.wait(60) == 2
        os.close(leader)
        assert said.count(b"Go ahead?") == 1
        assert said.count(b"This starts the motor forward at 10 Hz") == 2
        assert not any(simulator.drive(unit).take_writes() for unit in units)


@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_ctrl_c_ends_all_and_says_what_goes_on(folder: Path) -> None:
    units = {1: "gd350", 2: "gd350"}
    with drivebus.Simulator(units, transport="pty") as simulator:
        with drivebus.Bus(simulator) as bus:
            for unit in units:
                drive = bus.drive(unit)
                drive.prepare_control()
                drive.write({"P00.11": 600.0})
        words = ["--port", simulator.port, "-u", "1-2", "run", "50", "--yes", "--wait", "500"]
        command = [sys.executable, "-m", "drivebus", *words]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder) as program:
            turning = threading.Event()
            while not all(simulator.drive(unit).frequency > 0 for unit in units):
                turning.wait(0.01)
            program.send_signal(signal.SIGINT)
            _, said = program.communicate(timeout=60)
        assert program.returncode == 130
        assert "Interrupted." in said
        if sys.version_info >= (3, 11):
            assert "Motors that were started keep running" in said
        assert all(simulator.drive(unit).state == "forward" for unit in units)
