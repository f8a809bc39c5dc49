"""Where the output of the command line goes: narrow terminals, and alphabets that lack letters."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from drivebus.cli import cli

ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii"}


def on_a_terminal(monkeypatch: pytest.MonkeyPatch, columns: int, *words: str) -> list[str]:
    monkeypatch.setattr("rich.console.Console.is_terminal", property(lambda _: True))
    env = {"COLUMNS": str(columns), "TERM": "xterm"}
    result = CliRunner().invoke(cli, ["--port", "sim://gd350?clock=virtual", *words], env=env)
    assert result.exit_code == 0, result.output
    return re.sub(r"\x1b\[[\d;]*m", "", result.stdout).splitlines()


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
def test_no_terminal_is_too_narrow_for_a_name(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    """A name that is cut cannot be typed, and of a word that is broken nobody knows what it was."""
    text = "\n".join(on_a_terminal(monkeypatch, columns, "describe", "speed"))
    assert "\u2026" not in text
    for word in ("vf_separation_voltage", "rotation_speed", "verified", "P00.03"):
        assert word in text
    assert all(len(line) <= columns for line in text.splitlines() if "narrow it" not in line)


def test_what_fits_is_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = on_a_terminal(monkeypatch, 80, "read", "P00.03", "bus_voltage")
    assert [line.split()[0] for line in lines] == ["name", "P00.03", "bus_voltage"]
    narrow = on_a_terminal(monkeypatch, 24, "read", "P00.03", "running_frequency")
    assert [line.split()[0] for line in narrow if line.startswith(("name", "value"))] == ["name", "value"] * 2


@pytest.mark.parametrize("how", [["--json"], []])
def test_letters_that_an_encoding_lacks_are_no_end(tmp_path: Path, how: list[str]) -> None:
    folder = str(tmp_path / "mine")
    CliRunner().invoke(cli, ["profiles", "new", folder])
    path = tmp_path / "mine" / "registers.csv"
    path.write_text(
        path.read_text(encoding="utf-8").replace("An example", "K\u00fchlk\u00f6rper \u03a9"), encoding="utf-8"
    )
    words = [sys.executable, "-m", "drivebus", *how, "--profile", folder, "describe", "example_frequency"]
    done = subprocess.run(words, env={**os.environ, **ASCII}, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    if how:
        assert json.loads(done.stdout)["label"] == "K\u00fchlk\u00f6rper \u03a9"
    else:
        assert "K\\xfchlk\\xf6rper \\u03a9" in done.stdout
