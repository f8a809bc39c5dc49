"""What a terminal would obey: from folders, ports, profiles and adapters it comes out as letters, in JSON too."""

from __future__ import annotations

import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

EVIL = "a\x1b]0;x\x07\x1b[31m\x9b31m\rb\x08\x7f\u202e\u2066\u200f\u2028z"
"""ESC with a window's title, the same as one character of C1, a return, and letters that turn the line round."""
SIM = "sim://gd350?clock=virtual"


def run(*words: str, **options: str) -> Result:
    done = CliRunner(env=options or None).invoke(cli, [*words], prog_name="drivebus")
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done


def obeyed(text: str) -> set[str]:
    """The letters of *text* that a terminal would do something with."""
    return {letter for letter in text if not letter.isprintable() and letter != "\n"}


def check(done: Result) -> None:
    assert obeyed(done.output) == set()
    assert obeyed(done.stderr) == set()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A profile whose texts are evil wherever they may be, in a folder that is called so."""
    folder = tmp_path / EVIL
    folder.mkdir()
    quoted = json.dumps(EVIL)
    (folder / "profile.toml").write_text(
        f'name = "ours"\ntitle = {quoted}\nversion = 1\nsource = {quoted}\n[overlay]\nprofile = "gd350"\n'
        f'[[exceptions]]\ncode = 0x02\nname = "illegal_address"\nmeaning = {quoted}\nsource = {quoted}\n',
        encoding="utf-8",
    )
    evil = EVIL.replace("\r", "").replace("\u2028", "")
    (folder / "registers.csv").write_text(
        "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n"
        f'0x3002,bus_voltage,"{evil}","{evil}",10,no,,,,ro,yes,"{evil}","{evil}"\n',
        encoding="utf-8",
    )
    return folder


COMMANDS = [
    ["--port", SIM, "--profile", "{folder}", "info"],
    ["--port", SIM, "--profile", "{folder}", "status"],
    ["--port", SIM, "--profile", "{folder}", "read", "bus_voltage"],
    ["--port", SIM, "--profile", "{folder}", "read", "6300H"],
    ["--port", SIM, "--profile", "{folder}", "monitor", "bus_voltage", "--count", "1"],
    ["--port", SIM, "--profile", "{folder}", "backup", "{folder}/{evil}"],
    ["--port", SIM, "--profile", "{folder}", "diff", "{folder}/drive.toml"],
    ["--port", SIM, "--profile", "{folder}", "restore", "{folder}/drive.toml", "--yes"],
    ["--port", SIM, "diff", "{folder}/profile.toml"],
    ["--profile", "{folder}", "describe", "bus_voltage"],
    ["--profile", "{folder}", "describe", "{evil}"],
    ["--profile", "{folder}/{evil}", "describe", "bus_voltage"],
    ["profiles", "show", "{folder}"],
    ["profiles", "check", "{folder}"],
    ["profiles", "check", "{folder}/{evil}"],
    ["profiles", "new", "{folder}/new"],
    ["profiles", "new", "{folder}"],
    ["--port", "{evil}", "info"],
    ["--port", "socket://{evil}:1", "info"],
    ["--port", "sim://{evil}", "info"],
    ["--port", "spy://{evil}", "info"],
    ["--port", "{evil}", "doctor", "--listen", "0"],
    ["--port", SIM, "--unit", "{evil}", "info"],
    ["--port", SIM, "--baud", "{evil}", "info"],
    ["--port", SIM, "--format", "{evil}", "info"],
    ["--port", SIM, "--rs485", "{evil}", "info"],
    ["--port", SIM, "--variant", "{evil}", "info"],
    ["--port", SIM, "--variant", "speed_unit={evil}", "info"],
    ["--port", SIM, "read", "{evil}"],
    ["--port", SIM, "write", "{evil}"],
    ["--port", SIM, "write", "P00.11={evil}"],
    ["--port", SIM, "run", "{evil}"],
    ["--port", SIM, "jog", "--seconds", "{evil}"],
    ["--port", SIM, "scan", "--units", "{evil}"],
    ["--port", SIM, "scan", "--units", "9", "--timeout", "{evil}"],
    ["--port", SIM, "faults", "{evil}"],
    ["--port", SIM, "raw", "{evil}"],
    ["decode", "{evil}"],
    ["sim", "--units", "{evil}"],
    ["sim", "--link", "{folder}/{evil}/{evil}"],
    ["sim", "--fault", "{evil}=1"],
    ["{evil}"],
    ["--{evil}"],
    ["profiles", "{evil}"],
    ["completion", "{evil}"],
]


@pytest.mark.parametrize("how", [[], ["--json"]], ids=["text", "json"])
@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_nothing_that_comes_from_elsewhere_is_obeyed(folder: Path, words: list[str], how: list[str]) -> None:
    if "drive.toml" in " ".join(words):
        check(run("--port", SIM, "--profile", str(folder), "backup", str(folder / "drive.toml")))
    check(run(*how, *(word.format(folder=folder, evil=EVIL) for word in words)))


def test_what_the_environment_says_is_shown_as_letters() -> None:
    check(run("info", DRIVEBUS_PORT=EVIL))
    check(run("describe", "x", DRIVEBUS_PROFILE=EVIL))
    check(run("--port", SIM, "info", DRIVEBUS_UNIT=EVIL))


def test_what_an_adapter_says_of_itself_is_shown_as_letters(monkeypatch: pytest.MonkeyPatch) -> None:
    port = SimpleNamespace(device=f"/dev/{EVIL}", description=EVIL, serial_number=EVIL, hwid=EVIL)
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [port])
    shown = run("ports")
    check(shown)
    assert r"\x1b]0;x" in shown.stdout
    told = run("--json", "ports")
    check(told)
    assert json.loads(told.stdout)["description"] == EVIL


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize("how", [[], ["--json"]], ids=["text", "json"])
def test_a_port_that_is_called_so_is_named_as_letters(tmp_path: Path, how: list[str]) -> None:
    link = str(tmp_path / EVIL)
    with drivebus.Simulator({1: "gd350"}, link=link):
        for words in (["info"], ["reset"], ["--unit", "9", "read", "P00.03"]):
            check(run(*how, "--port", link, *words))


def test_json_says_what_it_was(folder: Path) -> None:
    told = run("--json", "--profile", str(folder), "describe", "bus_voltage")
    check(told)
    assert json.loads(told.stdout)["label"] == EVIL.replace("\r", "").replace("\u2028", "")
