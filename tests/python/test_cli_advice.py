"""What errors advise is data: texts of the library name no options, and what commands show no calls of Python's."""

from __future__ import annotations

import ast
import copy
import pickle
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

import drivebus
from drivebus.advice import Advice, Text, argument, call, joined
from drivebus.cli.app import cli
from drivebus.cli.present.error_wording import WORDS, in_commands

PACKAGE = Path(__file__).resolve().parent.parent.parent / "python/drivebus"
PYTHON = re.compile(r"\b[a-z_.]+\(\)|\b[a-z_]+=(?:True|False|…|\{)")
OPTION = re.compile(r"`--|`drivebus |\(--")
# Said to programs only: no command leads there.
OF_PROGRAMS = (
    "to_numpy()",
    "to_pandas()",
    "to_polars()",
    "poll() takes",
    "read() needs",
    "with_variants()",
    "write() refuses",
    "'as_",
)
# A template, which Home Assistant works out.
OF_TEMPLATES = ("as_timestamp(now())",)
# What a backup begins with, for who reads the file.
OF_FILES = ("# The parameters of one drive.",)
# Their words are those of a terminal.
OF_TERMINALS = ("doctor", "hal", "site")
MAKERS = {"Advice", "argument", "call"}


def library() -> Iterator[tuple[Path, ast.Module]]:
    for file in sorted(PACKAGE.rglob("*.py")):
        if "cli" not in file.relative_to(PACKAGE).parts:
            yield file, ast.parse(file.read_text(encoding="utf-8"))


def texts() -> Iterator[tuple[Path, str]]:
    """Every text of the library that is no docstring and no advice, with `…` where something is put in."""
    for file, tree in library():
        made = (node for node in ast.walk(tree) if isinstance(node, ast.Call) and name_of(node) in MAKERS)
        apart = {id(part) for node in made for part in ast.walk(node)}
        apart |= {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        apart |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if id(node) in apart:
                continue
            if isinstance(node, ast.JoinedStr):
                yield file, "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)  # type: ignore[misc]
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield file, node.value


def name_of(node: ast.Call) -> str:
    return node.func.id if isinstance(node.func, ast.Name) else ""


def advised() -> set[str]:
    """The names of all that the library advises."""
    found = set()
    for _, tree in library():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and name_of(node) in MAKERS and isinstance(node.args[0], ast.Constant):
                found.add(str(node.args[0].value))
    return found | {"run", "stop", "coast", "jog", "reset_fault"}  # made of a list


def test_each_that_is_advised_has_words_here_and_no_other_has() -> None:
    assert advised() == set(WORDS)


def test_no_text_of_the_library_names_a_call_outside_of_its_advice() -> None:
    named = {text for _, text in texts() if PYTHON.search(text)}
    assert [text for text in named if not any(program in text for program in (*OF_PROGRAMS, *OF_TEMPLATES))] == []


def test_no_text_of_the_library_names_an_option_of_the_program_above_it() -> None:
    named = {text for file, text in texts() if file.relative_to(PACKAGE).parts[0] not in OF_TERMINALS}
    assert [text for text in named if OPTION.search(text) and not text.startswith(OF_FILES)] == []


@pytest.mark.parametrize(
    ("said", "python", "here"),
    [
        (Text("say ", argument("force", True)), "say force=True", "say `--force`"),
        (Text("then ", call("reset_fault")), "then reset_fault()", "then `drivebus reset`"),
        (Text("give ", argument("profile")), "give profile=…", "give `--profile`"),
        (Text("give ", argument("profile", "gd350")), 'give profile="gd350"', "give `--profile gd350`"),
        (
            Text("give ", Advice("variants", "speed_unit", "variants={'speed_unit': …} for bus.drive()"), " ('Hz')"),
            "give variants={'speed_unit': …} for bus.drive() ('Hz')",
            "give `--variant speed_unit=…` ('Hz')",
        ),
        (
            joined(map(call, ("run", "stop", "coast")), ", ", " or "),
            "run(), stop() or coast()",
            "`drivebus run`, `drivebus stop` or `drivebus coast`",
        ),
        ("nothing of Python's (really)", "nothing of Python's (really)", "nothing of Python's (really)"),
        ('gd350 has no "xyz"', 'gd350 has no "xyz"', 'gd350 has no "xyz"; `drivebus list` shows what it has'),
    ],
)
def test_how_it_reads(said: str, python: str, here: str) -> None:
    assert str(said) == python
    assert in_commands(said) == here
    assert in_commands(Text("Error: ", said)) == f"Error: {here}"


def test_a_text_keeps_what_it_names_where_it_is_part_of_another_or_copied() -> None:
    said = Text(Text("a ", argument("store", True), "."), "", " b")
    assert (said, said.parts) == ("a store=True. b", ("a ", argument("store", True), ".", " b"))
    assert Text(Text("a. .").rstrip(" ."), ".") == "a."
    for same in (copy.deepcopy(said), pickle.loads(pickle.dumps(said))):
        assert (same, same.parts) == (said, said.parts)
    assert joined(["only"], ", ", " or ") == "only"


def test_a_program_has_what_helps_as_data() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus, pytest.raises(drivebus.Unverified) as refused:
        bus.drive(1).write("P14.03", 10)
    error = refused.value
    assert str(error) == error.text
    for same in (error, pickle.loads(pickle.dumps(error))):
        assert same.advice == (Advice("unverified", True, "unverified=True"),)
    assert drivebus.NoAnswer("nothing").advice == ()
    assert drivebus.DrivebusError().text == ""


def test_a_drive_with_a_fault(virtual: drivebus.Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = drivebus.Bus
    with opened(virtual) as bus:
        bus.drive(1).prepare_control()
    virtual.drive(1).trip(11)
    monkeypatch.setattr(drivebus, "Bus", lambda _port, **_how: opened(virtual))
    result = CliRunner().invoke(cli, ["--port", "line", "run", "5", "--yes"])
    assert result.exit_code == 2
    assert "then `drivebus reset`" in result.stderr


def test_a_command_that_is_advised_names_no_port_where_none_was_given() -> None:
    said = CliRunner().invoke(cli, ["panel"], env={"DRIVEBUS_PORT": ""}).stderr
    assert "`drivebus --port … monitor`" in said
