"""The JSON schema of `profile.toml`, as an editor uses it: what is sound passes, what has no such shape does not."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from jsonschema import Draft7Validator

import drivebus
from drivebus.cli import cli

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent.parent
VECTORS = ROOT / "tests/vectors/profiles"
SCHEMA: dict[str, Any] = json.loads(drivebus.Profile.schema())
CASES: list[dict[str, Any]] = tomllib.loads((VECTORS / "broken.toml").read_text(encoding="utf-8"))["case"]
SHAPE = {
    "an unknown key": ("requests", "max_word"),
    "an unknown table": ("", "watchdogs"),
    "a number where text belongs": ("title", "350"),
    "a key that a table needs": ("requests", "max_words"),
    "a kind of unit that there is not": ("kind", "converter"),
    "no kind of unit": ("", "kind"),
    "no version": ("", "version"),
    "an extension that does not say on what assumption": ("extends", "assumption"),
}
"""The broken profiles whose mistake is one of shape: the table where an editor marks it, and what it names there."""


def wrong(text: str) -> list[tuple[str, str]]:
    """Where an editor would mark something, by the first key of its path, and what it would say."""
    errors = Draft7Validator(SCHEMA).iter_errors(tomllib.loads(text))
    return [(str(error.path[0]) if error.path else "", error.message) for error in errors]


def test_it_is_a_schema() -> None:
    Draft7Validator.check_schema(SCHEMA)
    result = CliRunner().invoke(cli, ["profiles", "schema"])
    assert (result.exit_code, json.loads(result.stdout)) == (0, SCHEMA)


@pytest.mark.parametrize("family", drivebus.profiles())
def test_shipped_profiles_have_that_shape(family: str) -> None:
    assert wrong((ROOT / "crates/drives/profiles" / family / "profile.toml").read_text(encoding="utf-8")) == []


def test_so_has_one_with_every_table() -> None:
    text = (VECTORS / "ex9/profile.toml").read_text(encoding="utf-8")
    assert wrong(text) == []
    # Every table, so that none passes only because it is not there.
    assert set(tomllib.loads(text)) | {"extends", "overlay", "drop"} == set(SCHEMA["properties"])


@pytest.mark.parametrize("options", [[], ["--like", "gd350"], ["--overlay", "vfd500"]])
def test_an_editor_finds_it_beside_a_new_profile(tmp_path: Path, options: list[str]) -> None:
    folder = tmp_path / "mine"
    assert CliRunner().invoke(cli, ["profiles", "new", str(folder), *options]).exit_code == 0
    first, _, rest = (folder / "profile.toml").read_text(encoding="utf-8").partition("\n")
    assert first.startswith("#:schema ")
    assert json.loads((folder / first.removeprefix("#:schema ")).read_text(encoding="utf-8")) == SCHEMA
    assert wrong(rest) == []


@pytest.mark.parametrize("what", SHAPE)
def test_a_mistake_of_shape_is_marked(what: str) -> None:
    [case] = [case for case in CASES if case["what"] == what]
    text = (VECTORS / "ex9/profile.toml").read_text(encoding="utf-8")
    assert case["find"] in text
    table, named = SHAPE[what]
    marks = wrong(text.replace(case["find"], case["put"], 1))
    assert {place for place, _ in marks} == {table}
    assert any(named in said for _, said in marks)


def test_the_page_names_every_key() -> None:
    page = (ROOT / "docs/reference/profile-format.md").read_text(encoding="utf-8").partition("\n### profile.toml\n")[2]
    named = {word for quoted in re.findall(r"`([^`]+)`", page) for word in re.findall(r"[a-z_0-9]+", quoted)}
    assert named
    assert [key for key in sorted(set(keys(SCHEMA))) if key not in named] == []


def keys(schema: dict[str, Any]) -> Iterator[str]:
    """Every key that can stand in the file."""
    yield from schema.get("properties", ())
    for part in (*schema.get("properties", {}).values(), *schema.get("definitions", {}).values()):
        yield from keys(part)
