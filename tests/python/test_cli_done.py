"""Commands that write: values as they are typed, and what is said of what was done where the drive falls silent."""

from __future__ import annotations

import json
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

SIM = "sim://gd350?clock=virtual"


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["--port", SIM, "--profile", "gd350", *words], prog_name="drivebus")


@pytest.mark.parametrize("typed", ["5s", "5 s", "5.0s", "5.0"])
def test_a_value_may_have_its_unit(typed: str) -> None:
    result = run("--json", "write", f"P00.11={typed}")
    assert json.loads(result.stdout)["value"] == 5.0


@pytest.mark.parametrize(
    ("typed", "reason"),
    [
        ("P00.11=5Hz", "5Hz: not a number; give it in s"),
        ("P00.11=5ms", "5ms: not a number; give it in s"),
        ("P00.11=s", "s: not a number; give it in s"),
    ],
)
def test_another_unit_is_refused(typed: str, reason: str) -> None:
    result = run("write", typed)
    assert (result.exit_code, result.stdout) == (2, "")
    assert reason in result.stderr


def silence(monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    """Has what the command looks at when everything is done end as if the cable had been pulled by then."""

    def lost(*_: Any, **__: Any) -> None:
        raise drivebus.NoAnswer("unit 1, read 2100H: no answer within 500 ms")

    monkeypatch.setattr(drivebus.Drive, method, lost)


@pytest.mark.parametrize("command", ["stop", "coast"])
def test_a_command_that_was_confirmed_is_done(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    silence(monkeypatch, "status")
    result = run(command)
    assert (result.exit_code, result.stdout) == (0, "")
    assert (
        f"unit 1: {command} was done, but the state afterwards could not be read: unit 1, read 2100H" in result.stderr
    )


def test_json_says_that_the_state_is_not_known(monkeypatch: pytest.MonkeyPatch) -> None:
    silence(monkeypatch, "status")
    result = run("--json", "stop")
    nothing = {"state": None, "frequency": None, "setpoint": None, "fault": None}
    assert json.loads(result.stdout) == {"command": "stop", "unit": 1, **nothing}
    assert "could not be read" in result.stderr


def test_a_password_that_locks_the_drive_was_written() -> None:
    """From that moment the drive refuses every read, and so the one that was to show what was written."""
    result = run("--json", "write", "--unverified", "P00.11=4.0", "P07.00=1234")
    assert result.exit_code == 0, result.stderr
    assert [json.loads(line)["value"] for line in result.stdout.splitlines()] == [None, None]
    assert "P00.11, P07.00: written, but could not be read back: unit 1 refused" in result.stderr
    assert "password_protected" in result.stderr


def test_a_value_that_was_confirmed_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    silence(monkeypatch, "read")
    result = run("write", "P00.11=4.0", "P00.12=3.0")
    assert result.exit_code == 0
    assert "P00.11, P00.12: written, but could not be read back: unit 1, read 2100H" in result.stderr
    assert "Acceleration time 1" in result.stdout
    assert "Kept in RAM until the drive is switched off; --store keeps it in EEPROM." in result.stdout
