"""`--read-only`: what would write is refused before the drive hears a word, and what looks does as always."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

NO_MORE = {"DRIVEBUS_READ_ONLY": "0"}
WRITING = [
    ["run", "5", "--yes"],
    ["run", "5", "--yes", "--force"],
    ["stop"],
    ["stop", "--all"],
    ["coast"],
    ["jog", "--yes"],
    ["try", "step", "--from", "5", "--to", "9", "--max-current", "9", "--for", "1", "--yes"],
    ["reset", "--yes"],
    ["prepare", "--yes"],
    ["prepare", "--store", "--yes"],
    ["write", "P00.11=5.0", "--yes"],
    ["write", "6300H=1", "--force", "--yes"],
    ["restore", "{file}", "--yes"],
    ["hal", "--rpm-per-hz", "60"],
    ["raw", "01 06 00 0B 00 14", "--yes", "--force"],
    ["raw", "01 10 00 0B 00 01 02 00 14", "--yes"],
    ["raw", "01 05 00 00 FF 00", "--yes"],
    ["raw", "01 08 00 01 00 00", "--yes"],
]
LOOKING = [
    ["record", "{file}.csv", "--count", "1"],
    ["info"],
    ["status"],
    ["read", "P00.11"],
    ["monitor", "--count", "1"],
    ["scan", "--units", "1"],
    ["faults"],
    ["backup", "{file}2"],
    ["diff", "{file}"],
    ["restore", "{file}", "--dry-run"],
    ["raw", "01 03 21 03 00 01"],
    ["raw", "01 08 00 00 12 34"],
    ["describe", "P00.11"],
    ["discover", "{file.parent}/asked", "--group", "P05"],
]


@pytest.fixture
def simulator() -> Iterator[drivebus.Simulator]:
    with drivebus.Simulator({1: "gd350"}, transport="tcp") as simulator:
        yield simulator


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "drive.toml"
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        drive = bus.drive(1)
        drive.write("P00.11", 7.0, store=True)
        drive.backup(path)
    return path


def run(simulator: drivebus.Simulator, *words: str, env: dict[str, str] | None = None) -> Result:
    return CliRunner(env=env).invoke(cli, ["--port", simulator.port, *words], prog_name="drivebus")


@pytest.mark.parametrize("how", [["--read-only"], ["--read-only", "--profile", "gd350"], []], ids=" ".join)
@pytest.mark.parametrize("words", WRITING, ids=" ".join)
def test_what_writes_is_refused_before_anything_is_sent(
    simulator: drivebus.Simulator, file: Path, words: list[str], how: list[str]
) -> None:
    done = run(
        simulator, *how, *(word.format(file=file) for word in words), env=None if how else {"DRIVEBUS_READ_ONLY": "1"}
    )
    assert (done.exit_code, simulator.line.requests) == (2, 0), done.output
    for said in (words[0], "--read-only", "DRIVEBUS_READ_ONLY", "nothing was sent"):
        assert said in done.stderr
    assert ("emergency stop" in done.stderr) == (words[0] in ("stop", "coast"))


@pytest.mark.parametrize("words", LOOKING, ids=" ".join)
def test_what_looks_is_not(simulator: drivebus.Simulator, file: Path, words: list[str]) -> None:
    done = run(simulator, "--read-only", *(word.format(file=file) for word in words))
    assert done.exit_code in (0, 1), done.output
    assert "read-only" not in done.stderr
    assert simulator.drive(1).words_written == 0


def test_a_switch_that_is_off_refuses_nothing(simulator: drivebus.Simulator) -> None:
    assert run(simulator, "--profile", "gd350", "stop", env=NO_MORE).exit_code == 0
    assert simulator.drive(1).words_written == 1


def test_every_command_is_known_to_write_or_not() -> None:
    """A command that is added has to be put into one of the two."""
    looks = {"plot", "ports", "drives", "list", "doctor", "decode", "sniff", "replay", "share", "serve"}
    elsewhere = looks | {"panel", "sim", "profiles", "completion", "demo"}
    assert {words[0] for words in [*WRITING, *LOOKING]} | elsewhere == set(cli.commands)
