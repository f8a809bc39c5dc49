"""No error that the command line shows names a call of Python's."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

import drivebus
from drivebus.cli.advice import in_commands
from drivebus.cli.app import cli

PACKAGE = Path(__file__).resolve().parent.parent.parent / "python/drivebus"
PYTHON = re.compile(r"\b[a-z_.]+\(\)|\b[a-z_]+=(?:True|…|\{)")
# Said to programs only: no command leads there.
OF_PROGRAMS = (
    "to_numpy()",
    "to_pandas()",
    "prepare_control(setpoint=",
    "poll() takes",
    "resume=False",
    "read() needs",
    "with_variants()",
)


def texts() -> Iterator[str]:
    """Every text of the library that is no docstring, with `…` where something is put in."""
    for file in PACKAGE.rglob("*.py"):
        if "cli" in file.parts:
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
        plain = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                yield "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside | plain:
                yield node.value


def test_there_are_texts_that_name_calls() -> None:
    assert len([text for text in texts() if PYTHON.search(text)]) > 15


@pytest.mark.parametrize("text", sorted({text for text in texts() if PYTHON.search(text)}))
def test_what_is_shown_names_commands_and_options(text: str) -> None:
    if any(program in text for program in OF_PROGRAMS):
        return
    assert PYTHON.findall(in_commands(text)) == [], in_commands(text)


@pytest.mark.parametrize(
    ("python", "here"),
    [
        ("say force=True (`--force`)", "say `--force`"),
        ("Remove the cause, then reset_fault()", "Remove the cause, then `drivebus reset`"),
        (
            "give variants={'speed_unit': …} for bus.drive() (`--variant speed_unit=…`; 'Hz', 'rpm') says which",
            "give `--variant speed_unit=…` ('Hz', 'rpm') says which",
        ),
        ("nothing of Python's (really)", "nothing of Python's (really)"),
    ],
)
def test_how_it_reads(python: str, here: str) -> None:
    assert in_commands(python) == here


def test_a_drive_with_a_fault(virtual: drivebus.Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = drivebus.Bus
    with opened(virtual) as bus:
        bus.drive(1).prepare_control()
    virtual.drive(1).trip(11)
    monkeypatch.setattr(drivebus, "Bus", lambda _port, **_how: opened(virtual))
    result = CliRunner().invoke(cli, ["--port", "line", "run", "5", "--yes"])
    assert result.exit_code == 2
    assert "then `drivebus reset`" in result.stderr
