"""What commands say of what is going on: on its way, interrupted, declined, found."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
import drivebus.aio
from drivebus import ControlSource, Simulator, State
from drivebus.cli.app import cli

VIRTUAL = "sim://gd350?clock=virtual"


@pytest.fixture
def line(virtual: Simulator, monkeypatch: pytest.MonkeyPatch) -> Simulator:
    """A line whose drive obeys the bus and takes ten seconds to 50 Hz; each command opens it anew."""
    opened = drivebus.Bus

    def open_it(_port: str, **how: object) -> drivebus.Bus:
        return opened(virtual, **{name: how[name] for name in ("read_only",)})  # type: ignore[arg-type]  # as it was given

    with opened(virtual) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        drive.write({"P00.11": 10.0, "P00.12": 10.0})
    monkeypatch.setattr(drivebus, "Bus", open_it)
    return virtual


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["--port", "line", *words])


def test_a_motor_that_stops_is_said_to(line: Simulator) -> None:
    assert run("run", "10", "--yes", "--wait", "30").exit_code == 0
    said = run("stop").stdout
    assert re.fullmatch(r"unit 1: stopping, [1-9]\.\d\d Hz\n", said), said
    assert run("stop", "--wait", "30").stdout.startswith("unit 1: stopped, 0.00 of 10.00 Hz")
    assert line.drive(1).state == "stopped"


def test_a_motor_that_turns_round_is_said_to(line: Simulator) -> None:
    assert run("run", "10", "--yes", "--wait", "30").exit_code == 0
    assert re.fullmatch(r"unit 1: reversing, 9\.\d\d Hz\n", run("run", "10", "--reverse", "--yes").stdout)
    assert line.drive(1).frequency != 0
    assert run("run", "--reverse", "--yes", "--wait", "30").stdout.startswith("unit 1: reverse, 10.00 of 10.00 Hz")


def test_a_motor_that_speeds_up_is_said_to(line: Simulator) -> None:
    assert re.match(r"unit 1: forward, 0\.\d\d of 10\.00 Hz", run("run", "10", "--yes").stdout)
    assert line.drive(1).state == "forward"


@pytest.mark.skipif(sys.version_info < (3, 11), reason="errors have no notes")
def test_who_interrupts_a_wait_is_told_that_the_motor_runs(line: Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(drive: drivebus.Drive, *_: object, **__: object) -> None:
        drive.bus.sleep(1.0)
        raise KeyboardInterrupt

    monkeypatch.setattr(drivebus.Drive, "wait_for_speed", interrupted)
    result = run("--profile", "gd350", "run", "40", "--yes", "--wait", "60")
    first, second = result.stderr.splitlines()[-2:]
    assert (result.exit_code, first) == (130, "Interrupted.")
    expected = (
        r"The motor keeps running \(forward, 5\.\d\d Hz\): `drivebus --port line --profile gd350 stop` stops it\."
    )
    assert re.fullmatch(expected, second), second
    line.drive(1).trip(11)
    result = run("run", "40", "--yes", "--wait", "60")
    assert "keeps running" not in result.stderr


def test_a_scan_says_who_was_silent() -> None:
    result = CliRunner().invoke(cli, ["--port", "sim://1=gd350,3=gd350?clock=virtual", "scan", "--units", "1-5"])
    assert re.fullmatch(r"2 units, 3 silent, \d s", result.stdout.splitlines()[-1]), result.stdout


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize("columns", [80, 200])
def test_a_scan_on_a_terminal_shows_whole_lines(columns: int) -> None:
    import pty

    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "drivebus", "--port", "sim://1=gd350,2=gd350", "scan", "--units", "1-4"]
    settings = {**os.environ, "COLUMNS": str(columns), "LINES": "24", "TERM": "xterm"}
    with subprocess.Popen(command, stdout=theirs, stdin=theirs, stderr=theirs, env=settings) as child:
        os.close(theirs)
        seen = b""
        try:
            while came := os.read(ours, 65536):
                seen += came
        except OSError:
            pass  # Linux says so when the other side is closed
        assert child.wait() == 0
    os.close(ours)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", seen.decode())
    lines = [line.split("\r")[-1] for line in text.replace("\r\n", "\n").split("\n")]
    for unit in (1, 2):
        assert any(re.fullmatch(rf"unit {unit}: gd350, identification 0x01a0, [\d.]+ ms", line) for line in lines), text
    assert re.fullmatch(r"2 units, 2 silent, \d s", [line for line in lines if line.strip()][-1]), text


def test_a_complete_backup_is_not_replaced_unasked(tmp_path: Path) -> None:
    file = tmp_path / "golden.toml"
    words = ["--port", VIRTUAL, "backup", str(file)]
    assert CliRunner().invoke(cli, words).exit_code == 0
    golden = file.read_text(encoding="utf-8")
    refused = CliRunner().invoke(cli, words)
    assert refused.exit_code == 2
    for said in (f"{file} has a backup already", "unit 1", "--force to replace it", "nothing was read"):
        assert said in refused.stderr
    assert file.read_text(encoding="utf-8") == golden
    assert CliRunner().invoke(cli, [*words, "--force"]).exit_code == 0


@pytest.mark.parametrize("words", [["info"], ["profiles"], ["read", "P00.11", "output_current"]])
def test_tables_in_a_pipe_have_no_trailing_blanks(words: list[str]) -> None:
    lines = CliRunner().invoke(cli, ["--port", VIRTUAL, *words]).stdout.splitlines()
    assert lines
    assert [line for line in lines if line != line.rstrip()] == []


def test_a_state_is_its_name() -> None:
    name: object = "stopped"
    assert name == State.STOPPED
    assert State("power_off") is State.POWER_OFF
    assert (f"{State.POWER_OFF:>10}", str(State.POWER_OFF), f"{ControlSource.KEYPAD}") == (
        " power off",
        "power off",
        "keypad",
    )
    assert hash(State.FORWARD) == hash("forward")


def test_a_package_shows_its_public_names_only() -> None:
    assert dir(drivebus) == sorted(drivebus.__all__)
    assert dir(drivebus.aio) == sorted(drivebus.aio.__all__)
    assert "operations" not in dir(drivebus)


def test_values_have_as_many_digits_as_the_drive_counts() -> None:
    words = ["read", "running_frequency", "P00.11", "output_current", "identification_code"]
    lines = CliRunner().invoke(cli, ["--port", VIRTUAL, *words]).stdout.splitlines()[1:]
    assert [line.split()[1] for line in lines] == ["0.00", "10.0", "0.0", "416"]
    watched = CliRunner().invoke(cli, ["--port", VIRTUAL, "monitor", "--count", "1", "running_frequency"]).stdout
    assert watched.splitlines()[1].split(",")[1:] == ["0.00", ""]
    written = CliRunner().invoke(cli, ["--port", VIRTUAL, "write", "P00.11=5", "--yes"]).stdout.splitlines()[1]
    assert written.split()[:3] == ["P00.11", "5.0", "s"]
