"""The commands backup, restore and diff: what they print, what they ask, what they exit with."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

BAUD = 115_200


@pytest.fixture
def simulator() -> Iterator[drivebus.Simulator]:
    with drivebus.Simulator({1: "gd350"}, transport="tcp" if os.name == "nt" else "pty", baudrate=BAUD) as simulator:
        # A response delay of a real drive is no part of what is shown here.
        with drivebus.Bus(simulator) as bus:
            bus.drive(1).write("P14.03", 0, store=True, unverified=True)
        yield simulator


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "drive.toml"


def run(simulator: drivebus.Simulator | None, *words: object, **options: Any) -> Result:
    port = [] if simulator is None else ["--port", simulator.port, "--baud", str(BAUD)]
    return CliRunner().invoke(cli, [*port, *map(str, words)], prog_name="drivebus", **options)


def rows(result: Result) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


def store(simulator: drivebus.Simulator, *assignments: str) -> None:
    with drivebus.Bus(simulator) as bus:
        for name, _, value in (assignment.partition("=") for assignment in assignments):
            bus.drive(1).write(name, float(value), store=True, unverified=True)


def test_a_whole_round(simulator: drivebus.Simulator, file: Path) -> None:
    taken = run(simulator, "backup", file)
    assert taken.exit_code == 0
    assert "52 of the 54 parameters that the profile gd350 knows, of unit 1, INVT Goodrive350" in taken.stdout
    assert "P07.00  a password has no place in a file" in taken.stdout
    store(simulator, "P00.11=3.0", "P00.12=4.0")

    differs = run(simulator, "diff", file)
    assert (differs.exit_code, "2 of 45 parameters differ" in differs.stdout) == (1, True)

    asked = run(simulator, "restore", file)
    assert (asked.exit_code, "needs --yes" in asked.stderr) == (2, True)
    assert "planned" in asked.stdout

    before = simulator.drive(1).eeprom_writes
    dry = run(simulator, "restore", file, "--dry-run")
    assert (dry.exit_code, "Nothing was written" in dry.stdout) == (0, True)
    assert simulator.drive(1).eeprom_writes == before

    done = run(simulator, "restore", file, "--yes")
    assert (done.exit_code, "2 of 2 restored." in done.stdout) == (0, True)
    assert simulator.drive(1).eeprom_writes == before + 2
    assert run(simulator, "diff", file).exit_code == 0
    assert "Nothing to write." in run(simulator, "restore", file).stdout


def test_json_is_one_object_a_line(simulator: drivebus.Simulator, file: Path) -> None:
    [taken] = rows(run(simulator, "--json", "backup", file))
    assert (taken["family"], taken["identification"], taken["parameters"]) == ("gd350", 0x01A0, 52)
    assert [*taken["unread"]] == ["P02.01", "P07.00"]
    store(simulator, "P09.00=6")
    [found] = rows(run(simulator, "--json", "diff", file))
    assert (found["code"], found["left"]["value"], found["right"]["value"]) == ("P09.00", 0, 6)
    assert found["right"]["label"] == "Modbus"
    report = rows(run(simulator, "--json", "restore", file, "--yes", "--group", "P09"))
    assert {row["code"]: row["result"] for row in report}["P09.00"] == "restored"
    assert all(row["code"].startswith("P09") for row in report)


def test_what_is_not_restored_is_exit_1(simulator: drivebus.Simulator, file: Path) -> None:
    store(simulator, "P00.03=90", "P00.04=80")
    run(simulator, "backup", file)
    store(simulator, "P00.04=50")
    store(simulator, "P00.03=50")
    result = run(simulator, "restore", file, "--group", "P00.04", "--yes")
    assert (result.exit_code, "1 parameter was not restored" in result.stderr) == (1, True)
    assert "it would be beyond P00.03" in result.stdout


@pytest.mark.skipif(sys.version_info < (3, 11), reason="errors have no notes")
def test_a_restore_that_is_cut_off_says_what_was_done(
    simulator: drivebus.Simulator, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(simulator, "backup", file)
    store(simulator, "P00.11=3.0", "P00.12=4.0")
    write = drivebus.Bus.write

    def deaf(bus: drivebus.Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
        if address == 0x000C:
            simulator.line.drop_answers(1000)
        write(bus, unit, address, value, **how)

    with monkeypatch.context() as patch:
        patch.setattr(drivebus.Bus, "write", deaf)
        result = run(simulator, "restore", file, "--yes")
    assert result.exit_code == 3
    assert "restored before it: P00.11; a second restore writes only what is still missing" in result.stderr
    simulator.line.clear()
    assert run(simulator, "restore", file, "--yes").exit_code == 0


def test_taking_commands_from_elsewhere_is_said_first(simulator: drivebus.Simulator, file: Path) -> None:
    run(simulator, "backup", file)
    store(simulator, "P00.01=2")
    result = run(simulator, "restore", file, "--yes")
    assert "with P00.01 where it takes commands from" in result.stderr


def test_a_spoilt_file_is_exit_2_and_opens_no_port(file: Path) -> None:
    file.write_text(
        'format = 1\n[drive]\nfamily = "gd350"\n[parameters]\nP00.11 = { value = 1.0, raw = 11 }\nP0.99 = 3\n'
    )
    for words in (["restore", file, "--yes"], ["diff", file], ["diff", file, file]):
        result = run(None, *words)
        assert result.exit_code == 2
        assert f"{file}:5: P00.11" in result.stderr
        assert f"{file}:6: " in result.stderr


def test_files_are_compared_without_a_port(simulator: drivebus.Simulator, file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    run(simulator, "backup", file)
    store(simulator, "P00.11=3.0")
    run(simulator, "backup", other)
    result = run(None, "diff", file, other)
    assert (result.exit_code, f"{file} -> {other}: 1 of 45 parameters differ" in result.stdout) == (1, True)
    assert run(None, "diff", file, file).exit_code == 0


def test_the_factory_is_a_side(simulator: drivebus.Simulator, file: Path) -> None:
    store(simulator, "P14.03=5")
    assert run(simulator, "diff", "factory").exit_code == 0
    store(simulator, "P00.03=60")
    assert "50.00  60.00  Hz" in run(simulator, "diff", "factory").stdout
    run(simulator, "backup", file)
    assert run(None, "diff", "factory", file).exit_code == 1
    assert run(None, "diff", file, "factory").exit_code == 2


NOTES = pytest.mark.skipif(sys.version_info < (3, 11), reason="errors have no notes")


def interrupt(patch: pytest.MonkeyPatch, what: str, first: int) -> None:
    """Ctrl-C when *what*, `"read"` or `"write"`, is asked for at the address *first*."""
    request = getattr(drivebus.Bus, what)

    def interrupted(bus: drivebus.Bus, unit: int, address: int, *args: Any, **how: Any) -> Any:
        if address == first:
            raise KeyboardInterrupt
        return request(bus, unit, address, *args, **how)

    patch.setattr(drivebus.Bus, what, interrupted)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["diff"], "Interrupted."),
        pytest.param(["backup", "--force"], "16 of 52 parameters are in ", marks=NOTES),
        pytest.param(["restore", "--yes"], "restored before it: P00.11; a second restore", marks=NOTES),
    ],
)
def test_who_interrupts_is_told_what_was_done(
    simulator: drivebus.Simulator, file: Path, monkeypatch: pytest.MonkeyPatch, command: list[str], said: str
) -> None:
    run(simulator, "backup", file)
    store(simulator, "P00.11=3.0", "P00.12=4.0")
    with monkeypatch.context() as patch:
        if command[0] == "restore":
            interrupt(patch, "write", 0x000C)
        else:
            interrupt(patch, "read", 0x0206)
        result = run(simulator, *command, file)
    assert (result.exit_code, said in result.stderr) == (130, True)
    assert run(simulator, *command, file).exit_code == (1 if command[0] == "diff" else 0)


def test_going_on_is_said(simulator: drivebus.Simulator, file: Path) -> None:
    run(simulator, "backup", file)
    lines = file.read_text().replace("complete = true", "complete = false").splitlines(keepends=True)
    file.with_name("drive.toml.part").write_text("".join(line for line in lines if not line.startswith("P0")))
    assert "Going on where it was: 11 of 52 are there." in run(simulator, "backup", file).stderr
    file.with_name("drive.toml.part").write_text("".join(lines))
    assert "Going on" not in run(simulator, "backup", file, "--fresh").stderr


def test_who_cannot_ask_for_the_state_is_told_to_look(tmp_path: Path) -> None:
    """The address of the VFD500's state word is printed nowhere."""
    file = tmp_path / "drive.toml"
    with drivebus.Simulator({1: "vfd500"}, transport="tcp" if os.name == "nt" else "pty", baudrate=BAUD) as simulator:
        assert run(simulator, "--profile", "vfd500", "backup", file).exit_code == 0
        file.write_text(file.read_text().replace("P07.01 = { value = 0, raw = 0 }", "P07.01 = { value = 1 }"))
        result = run(simulator, "--profile", "vfd500", "restore", file, "--yes")
    assert (result.exit_code, "cannot be asked of this family: look" in result.stderr) == (0, True)


def test_a_second_write_of_one_parameter_is_asked_for(tmp_path: Path) -> None:
    """A GD300 beyond its own limits: that it has a write to RAM alone is only assumed."""
    file = tmp_path / "gd300.toml"
    with drivebus.Simulator({1: "gd300"}, transport="tcp" if os.name == "nt" else "pty", baudrate=BAUD) as simulator:
        with drivebus.Bus(simulator) as bus:
            for address, word in ((0x0003, 7000), (0x0004, 6000)):
                bus.write(1, address, word)
        assert run(simulator, "--profile", "gd300", "backup", file).exit_code == 0
        with drivebus.Bus(simulator) as bus:
            for address, word in ((0x0004, 5000), (0x0003, 5000), (0x8003, 9000), (0x0004, 8000)):
                bus.write(1, address, word)
        simulator.drive(1).power_cycle()
        refused = run(simulator, "--profile", "gd300", "restore", file, "--yes", "--group", "P00")
        assert (refused.exit_code, "`--twice`" in refused.stdout.replace("\n", " ")) == (1, True)
        assert run(simulator, "--profile", "gd300", "restore", file, "--yes", "--twice").exit_code == 0
        assert run(simulator, "--profile", "gd300", "diff", file).exit_code == 0


def test_what_another_family_lacks_is_named(simulator: drivebus.Simulator, tmp_path: Path) -> None:
    """P30.02 is a VFD500's; no parameter of a GD350 has that code."""
    file = tmp_path / "vfd500.toml"
    with drivebus.Bus("sim://vfd500?clock=virtual") as bus:
        bus.drive(1, "vfd500").backup(file)
    result = run(simulator, "restore", file, "--force", "--dry-run")
    assert result.exit_code == 1
    assert "P30.02" in result.stdout
    assert "see above" in result.stderr


def test_a_spoilt_beginning_says_how_to_begin_anew(simulator: drivebus.Simulator, file: Path) -> None:
    part = file.with_name("drive.toml.part")
    part.write_text("format = 1\n[drive")
    result = run(simulator, "backup", file)
    assert (result.exit_code, f"{part}:2: " in result.stderr, "--fresh" in result.stderr) == (2, True, True)
    assert run(simulator, "backup", file, "--fresh").exit_code == 0


def test_when_it_was_begun_is_said(simulator: drivebus.Simulator, file: Path) -> None:
    run(simulator, "backup", file)
    begun = file.read_text().replace("complete = true", "complete = false")
    lines = [line for line in begun.splitlines() if not line.startswith(("P0", "taken"))]
    lines.insert(lines.index("[parameters]") - 1, "taken = 2025-01-31T12:00:00Z")
    file.with_name("drive.toml.part").write_text("\n".join(lines))
    result = run(simulator, "backup", file)
    assert "begun 2025-01-31 12:00 UTC" in result.stdout
    assert "`--fresh` reads them again" in result.stderr


@pytest.mark.skipif(os.name == "nt", reason="there are no such files there")
def test_what_is_no_file_is_never_replaced(simulator: drivebus.Simulator, tmp_path: Path) -> None:
    """`/dev/null`, for who has the right to replace it."""
    place = tmp_path / "queue"
    os.mkfifo(place)
    for words in (["backup", place], ["backup", place, "--force"]):
        result = run(simulator, *words)
        assert (result.exit_code, "is not a file" in result.stderr) == (2, True)
    assert place.is_fifo()
    assert list(tmp_path.iterdir()) == [place]


def test_a_long_text_that_is_no_backup_is_not_told_line_by_line(simulator: drivebus.Simulator, file: Path) -> None:
    file.write_text("Dear diary\n" * 50)
    result = run(simulator, "backup", file)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) < 10
    assert "--force" in result.stderr


def test_a_shell_completes_files() -> None:
    for command in ("diff", "restore", "backup"):
        words = {"COMP_WORDS": f"drivebus {command} pump", "COMP_CWORD": "2", "_DRIVEBUS_COMPLETE": "bash_complete"}
        assert CliRunner().invoke(cli, [], prog_name="drivebus", env=words).stdout.strip() == "file,pump"


def test_a_shell_completes_groups() -> None:
    def complete(*words: str) -> list[str]:
        *before, begun = words
        return [item.value for item in ShellComplete(cli, {}, "drivebus", "").get_completions(before, begun)]

    # VFD500: group 27 is its states, r25 its faults.
    assert {"P00", "r25", "r27"} <= {*complete("--profile", "vfd500", "restore", "x.toml", "--group", "")}
    assert complete("--profile", "gd350", "restore", "x.toml", "--group", "p00.1")[:2] == ["P00.10", "P00.11"]
    assert "P14" in complete("restore", "--group", "P1")


def test_the_factory_is_not_held_against_itself(file: Path) -> None:
    result = run(None, "diff", "factory", "factory")
    assert (result.exit_code, "does not differ from itself: give a FILE" in result.stderr) == (2, True)
    result = run(None, "diff", file, "factory")
    assert (result.exit_code, f"drivebus diff factory {file}" in " ".join(result.stderr.split())) == (2, True)


def test_another_version_of_the_profile_is_said(simulator: drivebus.Simulator, file: Path) -> None:
    run(simulator, "backup", file)
    assert "version" not in run(simulator, "diff", file).stderr
    file.write_text(file.read_text().replace("profile_version = 1", "profile_version = 99"))
    result = run(simulator, "restore", file)
    assert (result.exit_code, "version 99 of the profile gd350, and this is version 1" in result.stderr) == (0, True)
