"""`tests/vectors/traps.toml` against the shipped profiles.

A misprint that is corrected stays corrected, and what looks like a mistake and is none stays as it is. The format is
explained in `tests/vectors/README.md`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tomli

import drivebus
from drivebus import Profile

ROOT = Path(__file__).resolve().parent.parent.parent
TRAPS: list[dict[str, Any]] = tomli.loads((ROOT / "tests/vectors/traps.toml").read_text(encoding="utf-8"))["trap"]
CHECKS = "row unknown refuses no_rows no_fields absent faults exception codes no_codes no_commands other_commands test"


def listed(value: Any) -> Any:
    """*value* as TOML has it."""
    return list(value) if isinstance(value, tuple) else value


def numbered(table: dict[str, Any]) -> dict[int, Any]:
    return {int(key, 0): value for key, value in table.items()}


@pytest.mark.parametrize("trap", TRAPS, ids=lambda trap: f"{trap['family']}-{trap['what'][:40]}")
def test_nobody_walks_into_it(trap: dict[str, Any]) -> None:
    profile = Profile.builtin(trap["family"])
    checks = trap.keys() - {"family", "what", "source"}
    assert checks, "a trap without a check"
    assert checks <= set(CHECKS.split())
    if row := dict(trap.get("row", {})):
        told = profile.describe(row.pop("name"))
        raw, says = row.pop("raw", None), row.pop("says", {})
        fields = {} if raw is None else profile.fields(told.name, raw)
        assert fields | says == fields
        assert not fields.keys() & set(trap.get("no_fields", ()))
        choices = numbered(row.pop("choices", {}))
        assert choices.items() <= (told.choices or {}).items()
        assert row.pop("note", "") in told.note
        assert {key: listed(getattr(told, key)) for key in row} == row
        assert [getattr(told, key) for key in trap.get("unknown", ())] == [None] * len(trap.get("unknown", ()))
        for value in trap.get("refuses", ()):
            with pytest.raises(ValueError, match=told.code or told.name):
                profile.encode(told.name, value)
    for name in trap.get("no_rows", ()):
        # A code that no row lists is at most a raw word.
        try:
            assert not profile.describe(name).listed
        except drivebus.NotAllowed:
            continue
    assert [profile.name_at(address) for address in trap.get("absent", ())] == [None] * len(trap.get("absent", ()))
    for number, (mnemonic, label) in numbered(trap.get("faults", {})).items():
        fault = profile.fault(number)
        assert fault.mnemonic == mnemonic
        assert label in fault.label
    if exception := trap.get("exception"):
        assert exception["meaning"] in profile.exception(exception["code"])[1]
    known = {row["code"]: row["family"] for row in profile.identifications()}
    assert numbered(trap.get("codes", {})).items() <= known.items()
    assert not known.keys() & set(trap.get("no_codes", ()))
    assert not profile.command_codes().keys() & set(trap.get("no_commands", ()))
    assert numbered(trap.get("other_commands", {})).items() <= profile.command_codes().items()
    if test := trap.get("test"):
        assert (ROOT / test["file"]).exists()
        assert "printed" in (ROOT / "tests/vectors" / test["vectors"]).read_text(encoding="utf-8")


def test_every_family_with_a_document_of_its_own_has_one() -> None:
    assert {trap["family"] for trap in TRAPS} == set(drivebus.profiles()) - {"gd600-rectifier", "chv100"}
