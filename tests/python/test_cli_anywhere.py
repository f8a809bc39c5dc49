"""Options of the whole program behind its command, and the groups of its help."""

from __future__ import annotations

import json

import click
import pytest
from click.testing import CliRunner, Result

from drivebus.cli.app import cli
from drivebus.cli.option_order import in_front

TWO = "sim://1=gd350,2=gd350?clock=virtual"


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, list(words))


@pytest.mark.parametrize(
    "words",
    [
        ["--port", TWO, "--unit", "2", "--json", "info"],
        ["info", "--port", TWO, "--unit", "2", "--json"],
        ["--port", TWO, "info", "-u2", "--json"],
        ["-p", TWO, "--json", "info", "--unit=2"],
    ],
    ids=lambda words: " ".join(words),
)
def test_an_option_stands_before_the_command_or_behind_it(words: list[str]) -> None:
    result = run(*words)
    found = json.loads(result.stdout.splitlines()[0])
    assert (found["unit"], found["family"]) == (2, "gd350"), result.output


def test_the_example_of_the_families_page() -> None:
    result = run("describe", "P00.11", "--profile", "gd350")
    assert result.exit_code == 0
    assert "P00.11" in result.stdout


def test_an_option_of_the_commands_own_is_the_commands() -> None:
    result = run("doctor", "sim://gd350?clock=virtual", "--unit", "1", "--json")
    assert result.exit_code == 0
    assert '"unit": 1' in result.stdout


def test_one_that_is_given_twice_is_refused() -> None:
    result = run("-u", "1", "-p", TWO, "status", "--unit", "2")
    assert result.exit_code == 2
    assert "--unit is given twice: before the command and behind it" in result.stderr


def test_one_that_nobody_has_is_refused_as_before() -> None:
    result = run("status", "--nonsense")
    assert result.exit_code == 2
    assert "No such option" in result.stderr
    assert "--nonsense" in result.stderr


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], []),
        (["-h"], ["-h"]),
        (["nonsense", "-u", "2"], ["nonsense", "-u", "2"]),
        (["run", "-5"], ["run", "-5"]),
        (["run", "5", "-u", "2", "-y"], ["-u", "2", "run", "5", "-y"]),
        (["run", "--wait", "-p", "5"], ["run", "--wait", "-p", "5"]),
        (["read", "--", "-u", "2"], ["read", "--", "-u", "2"]),
        (["-u", "2"], ["-u", "2"]),
        (["read", "a", "--json", "b", "--verify"], ["--json", "read", "a", "b", "--verify"]),
        (["status", "--variant", "a=b", "--variant", "c=d"], ["--variant", "a=b", "--variant", "c=d", "status"]),
        (["profiles", "show", "gd350", "--json"], ["--json", "profiles", "show", "gd350"]),
        (["read", "-u"], ["-u", "read"]),
    ],
    ids=lambda words: " ".join(words) or "nothing",
)
def test_what_is_moved(words: list[str], expected: list[str]) -> None:
    assert in_front(cli, click.Context(cli), words) == expected


@pytest.mark.parametrize("width", ["40", "80", "200"])
def test_the_help_cuts_nothing_and_has_every_command(width: str) -> None:
    result = CliRunner().invoke(cli, ["--help"], env={"COLUMNS": width})
    commands = result.stdout.split("Inspect:")[1]
    assert "..." not in commands
    assert all(f"\n  {name} " in commands for name in cli.commands)
    for title in ("Move and write:", "Save:", "Find out:", "Listen:", "Tools:"):
        assert f"\n{title}\n" in result.stdout
