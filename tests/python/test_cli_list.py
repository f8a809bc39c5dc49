"""`drivebus list`, and names that are none: what there is, and nothing that only looks like a guess."""

from __future__ import annotations

import json
import re
import sys

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

GD350 = drivebus.Profile.builtin("gd350")


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["--profile", "gd350", *words])


def rows(*words: str) -> list[dict[str, object]]:
    result = run("--json", *words)
    assert result.exit_code == 0, result.stderr
    return [json.loads(line) for line in result.stdout.splitlines()]


def test_groups_are_listed_and_hold_all_names() -> None:
    listed = {row["group"]: row["names"] for row in rows("list")}
    assert listed["registers"] == sum(GD350.describe(name).kind == "register" for name in GD350.names())
    assert listed["monitor"] == len(GD350.monitor_names())
    counted = sum(int(str(count)) for group, count in listed.items() if group != "monitor")
    assert counted == len(GD350.names())


@pytest.mark.parametrize("family", drivebus.profiles())
def test_each_group_of_each_family_can_be_listed(family: str) -> None:
    known = drivebus.Profile.builtin(family)
    groups = [row["group"] for row in rows("--profile", family, "list")]
    names = {row["name"] for row in rows("--profile", family, "list", "all")}
    assert names == {known.describe(name).name for name in known.names()}
    for group in groups[2:]:
        listed = rows("--profile", family, "list", str(group).lower())
        assert {str(row["code"]).replace("-", ".").partition(".")[0] for row in listed} == {group}


def test_a_row_has_what_one_needs_to_write_it() -> None:
    [row] = [row for row in rows("list", "P00") if row["code"] == "P00.11"]
    assert row == {
        "name": "acceleration_time_1",
        "code": "P00.11",
        "address": "000BH",
        "unit": "s",
        "range": "0.0 to 3600.0",
        "access": "run",
        "label": "Acceleration time 1",
    }


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_a_small_window_shows_a_line_for_each_row() -> None:
    from .screens import on_a_terminal

    titles, *listed = on_a_terminal(["--profile", "gd350", "list", "P00"], (80, 24)).lines[1:]
    assert titles.split() == ["code", "unit", "range", "label"]
    assert "P00.11  s     0.0 to 3600.0                     Acceleration time 1" in listed
    assert "P00.06        7 = PID, 8 = Modbus               Where frequency A comes from" in listed


def test_a_row_is_described_in_words_and_with_all_for_programmers() -> None:
    told = run("describe", "P00.11").stdout
    assert re.search(r"^range +0\.0 to 3600\.0$", told, re.MULTILINE)
    assert re.search(r"^writable +any time$", told, re.MULTILINE)
    assert "high first" not in told
    assert re.search(r"^high first +no$", run("describe", "P00.11", "--all").stdout, re.MULTILINE)


def test_a_group_that_is_none_names_those_there_are() -> None:
    result = run("list", "P99")
    assert result.exit_code == 2
    assert 'gd350 has no group "P99"; it has registers, monitor, parameters, all, P00, P01' in result.stderr


def test_matches_are_counted() -> None:
    assert run("describe", "P00").stdout.startswith('gd350 has 13 matches for "P00":\n')
    assert run("describe", "r").stdout.startswith("gd350 has ")
    assert "the best 20 of them; more words narrow it" in run("describe", "e").stdout


@pytest.mark.parametrize("name", ["zzz", "nonsense"])
def test_what_is_near_to_nothing_is_told_where_the_names_are(name: str) -> None:
    result = run("--port", "sim://gd350?clock=virtual", "read", name)
    assert result.exit_code == 2
    assert f'gd350 has no "{name}"; `drivebus list` shows what it has' in result.stderr
    with pytest.raises(drivebus.NotAllowed, match=f'^gd350 has no "{name}"$'):
        GD350.describe(name)


@pytest.mark.parametrize("name", ["p00-11", "P0011", "p0,11", "acceleration_time_1"])
def test_one_rule_for_names(name: str) -> None:
    port = ["--port", "sim://gd350?clock=virtual"]
    assert run(*port, "read", name).stdout.splitlines()[1].split()[:3] == ["P00.11", "10.0", "s"]
    assert run("describe", name).stdout == run("describe", "P00.11").stdout
