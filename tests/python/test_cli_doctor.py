"""`drivebus doctor`: what it prints, what it exits with, and that an interrupt leaves the port free."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from typing import Any

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

SIM = "sim://1=gd350,2=gd350?clock=virtual&seed=1"


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, words, prog_name="drivebus")


def rows(result: Result) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


def test_a_sound_line_exits_0_and_says_so() -> None:
    result = run("doctor", SIM)
    assert (result.exit_code, result.stderr) == (0, "")
    assert re.fullmatch(r"Nothing is wrong. Took \d+ s.", result.stdout.splitlines()[-1])
    assert "WARNING" not in result.stdout


def test_each_finding_is_one_object() -> None:
    found = rows(run("--json", "doctor", SIM, "--unit", "2"))
    assert all(
        row.keys() == {"step", "name", "severity", "unit", "text", "advice", "values", "exit_code"} for row in found
    )
    assert {row["unit"] for row in found} == {None, 2}
    assert {row["severity"] for row in found} == {"ok", "note"}
    [turnaround] = [row for row in found if row["name"] == "turnaround"]
    assert turnaround["values"].keys() == {"turnaround_min", "turnaround_median", "turnaround_max"}


@pytest.mark.parametrize(
    ("port", "words", "code", "name"),
    [
        (SIM, ["--unit", "9"], 3, "nobody_answers"),
        (f"{SIM}&flip_bit=0.3", ["--unit", "1"], 6, "damaged"),
        (f"{SIM}&flip_bit=1", ["--unit", "1"], 6, "two_units"),
        (f"{SIM}&silence=0.3", ["--unit", "1"], 3, "lost_answers"),
        ("/dev/ttyNoSuchPort", [], 5, "port"),
    ],
)
def test_it_exits_with_the_code_of_the_worst(port: str, words: list[str], code: int, name: str) -> None:
    result = run("--json", "doctor", port, *words)
    assert result.exit_code == code
    [worst] = [row for row in rows(result) if row["name"] == name]
    assert worst["exit_code"] == code
    assert worst["advice"] or name == "port"
    assert "Traceback" not in result.output


def test_the_options_before_the_command_count() -> None:
    found = rows(run("--json", "--port", SIM, "--unit", "2", "--baud", "9600", "--format", "8N1", "doctor"))
    assert "at 9600 8N1" in found[0]["text"]
    assert {row["unit"] for row in found} == {None, 2}
    behind = rows(run("--json", "--port", SIM, "--unit", "2", "doctor", "-u", "1", "-b", "38400", "-f", "8O1"))
    assert "at 38400 8O1" in behind[0]["text"]
    assert {row["unit"] for row in behind} == {None, 1}


def test_without_a_unit_whoever_answers_is_examined() -> None:
    """SIM has the units 1 and 2; a unit that nobody named is no reason to ask unit 1 alone."""
    for words in (["doctor", SIM], ["--port", SIM, "doctor"]):
        assert {1, 2} <= {row["unit"] for row in rows(run("--json", *words))}


def test_a_unit_that_does_not_say_what_it_is_can_be_named() -> None:
    """A GD600 has no identification code. Its P00.01 and P00.06 are asked for where it was named."""
    unknown = rows(run("--json", "doctor", "sim://gd600?clock=virtual"))
    assert "control" not in {row["name"] for row in unknown}
    [control] = [row for row in rows(named("gd600")) if row["name"] == "control"]
    assert "P00.01" in control["text"]
    assert "`drivebus --port 'sim://gd600?clock=virtual' --profile gd600 prepare`" in control["advice"]


def test_what_is_not_known_is_not_said_to_be_well() -> None:
    """What makes a CHF100A obey the bus is not known; the fault register of a GD600 is assumed."""
    [control] = [row for row in rows(named("chf100a")) if row["name"] == "control"]
    assert (control["severity"], "is not known" in control["text"]) == ("note", True)
    [fault] = [row for row in rows(named("gd600")) if row["name"] == "fault"]
    assert (fault["severity"], "--unverified" in fault["text"]) == ("note", True)
    assert "fault" not in {row["name"] for row in rows(named("gd600", "--unverified"))}


def named(family: str, *words: str) -> Result:
    return run("--json", "--profile", family, *words, "doctor", f"sim://{family}?clock=virtual")


def test_a_unit_that_says_what_it_is_is_not_taken_for_another() -> None:
    result = run("--json", "--profile", "vfd500", "doctor", SIM, "--unit", "1")
    [family] = [row for row in rows(result) if row["name"] == "family"]
    assert (result.exit_code, family["severity"], "gd350" in family["text"]) == (2, "warning", True)
    assert "DRIVEBUS_PROFILE" in family["advice"]
    assert run("--profile", "gd350", "doctor", SIM).exit_code == 0


def test_a_profile_that_is_none_opens_nothing() -> None:
    result = run("--profile", "gd355", "doctor", "/dev/ttyNoSuchPort")
    assert (result.exit_code, "gd350" in result.stderr, result.stdout) == (2, True, "")


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize("command", ["doctor", "status"])
def test_the_direction_is_asked_for(command: str) -> None:
    with drivebus.Simulator({1: "gd350"}) as simulator:
        result = run("--port", simulator.port, "--rs485", "rts", command)
    assert result.exit_code == 5
    assert "RTS cannot be moved" in result.output


def test_usage_errors_exit_2() -> None:
    for words in (
        ["doctor"],
        ["doctor", SIM, "--format", "9E1"],
        ["doctor", SIM, "--unit", "0"],
        ["doctor", "sim://x"],
    ):
        assert run(*words).exit_code == 2


@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_an_interrupt_leaves_the_port_free() -> None:
    with drivebus.Simulator({1: "gd350"}) as simulator:
        command = [sys.executable, "-m", "drivebus", "--json", "doctor", simulator.port, "--listen", "600"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert "opened at" in process.stdout.readline()
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=100)
        assert process.returncode != 0
        assert "Traceback" not in said
        with drivebus.Bus(simulator.port) as bus:
            assert bus.echo(1) > 0
