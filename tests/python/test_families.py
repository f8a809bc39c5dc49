"""Every family against `tests/vectors/families.toml`, a table typed from the manuals, through the Python API.

Rust walks the same file in `crates/drives/tests/shared_vectors/families.rs`. The format is explained in
`tests/vectors/README.md`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import tomli

import drivebus
from drivebus import NotAllowed, Profile

TABLE = tomli.loads((Path(__file__).resolve().parent.parent / "vectors" / "families.toml").read_text(encoding="utf-8"))
FAMILIES: list[dict[str, Any]] = TABLE["family"]
EXAMPLES: list[dict[str, Any]] = TABLE["example"]
COMMANDS = [
    "run_forward",
    "run_reverse",
    "jog_forward",
    "jog_reverse",
    "stop",
    "coast",
    "reset_fault",
    "jog_stop",
]


def place_of(family: dict[str, Any], command: str) -> int | None:
    """Where a command goes: most families have one register for all."""
    elsewhere: dict[str, int] = family["commands"].get("elsewhere", {})
    return elsewhere.get(command, given(family["commands"]["register"]))


def words_of(family: dict[str, Any], command: str) -> list[tuple[int | None, int | None]]:
    """All that a command writes, in order: which way the motor turns may go first."""
    first: dict[str, list[int]] = family["commands"].get("first", {})
    before: list[tuple[int | None, int | None]] = (
        [(place, word) for place, word in [first[command]]] if command in first else []
    )
    return [*before, (place_of(family, command), given(family["commands"][command]))]


every_family = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family["name"])


def given(word: int | str) -> int | None:
    """A number of the table; None for what a family does not have."""
    assert isinstance(word, int) or word == "none"
    return word if isinstance(word, int) else None


def words(section: dict[str, Any]) -> dict[int, str]:
    """What a section of the table says of words: those of its keys that are hex."""
    return {int(key, 16): value for key, value in section.items() if key.startswith("0x")}


def test_the_table_has_every_family() -> None:
    assert {family["name"] for family in FAMILIES} == set(drivebus.profiles())
    assert len(FAMILIES) == 55


@every_family
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_that_of_the_table(family: dict[str, Any], command: str) -> None:
    profile, table = Profile.builtin(family["name"]), family["commands"]
    code = given(table[command])
    if code is None:
        with pytest.raises(NotAllowed, match=family["name"]):
            profile.command(command)
        assert command not in profile.commands()
        return
    assert profile.command(command) == (place_of(family, command), code)
    assert [*filter(None, [profile.command_first(command)]), profile.command(command)] == words_of(family, command)
    assert profile.commands()[command] == code
    assert (profile.command_reason(command) is not None) == (command in table["needs_unverified"])


@every_family
def test_no_other_code_is_defined(family: dict[str, Any]) -> None:
    profile, table = Profile.builtin(family["name"]), family["commands"]
    here = [command for command in COMMANDS if command not in table.get("elsewhere", {})]
    codes: dict[int | None, str] = {}
    for command in here:
        code = given(table[command])
        # Two that another word tells apart have one code.
        codes[code] = f"{codes[code]} or {command}" if command in table.get("first", {}) and code in codes else command
    codes.pop(None, None)
    codes.update({int(code): label for code, label in table["other"].items()})
    assert profile.command_codes() == codes
    assert [step["word"] for step in profile.start_sequence()] == table.get("sequence", [])
    assert profile.command_address == given(table["register"])
    others: dict[int, dict[int, str]] = {}
    for command, place in table.get("elsewhere", {}).items():
        others.setdefault(place, {})[table[command]] = command
    assert {place: words for place, words in profile.command_registers().items() if place in others} == others
    assert set(profile.command_registers()) == {*others, given(table["register"])} - {None}
    tables = [range(first, first + 0x10000) for first in (0, 0x1_0000, 0x2_0000, 0x4_0000)]
    plain = [place for table in tables for place in table if profile.plain_address(place) == place]
    assert [place for place in plain if profile.is_command(place)] == table["moves"]
    assert profile.kind == family["kind"]


@every_family
def test_states_are_those_of_the_table(family: dict[str, Any]) -> None:
    profile, table = Profile.builtin(family["name"]), family.get("states")
    register = profile.role("state")
    if table is None:
        assert register is None
        return
    assert register is not None
    assert profile.address(register) == table["register"]
    assert (profile.state_reason() is not None) == table["needs_unverified"]
    for raw, state in words(table).items():
        assert profile.state(raw) == state, f"{raw:04X}"


@every_family
def test_ram_and_eeprom_are_reached_by_the_familys_own_rule(family: dict[str, Any]) -> None:
    profile, table = Profile.builtin(family["name"]), family.get("memory")
    if table is None:
        assert profile.memory() is None
        return
    ram = given(table["ram"])
    if given(table["eeprom"]) is None:
        with pytest.raises(NotAllowed):
            profile.address(table["parameter"], store=True)
    else:
        assert profile.address(table["parameter"], store=True) == table["eeprom"]
    if ram is None:
        assert profile.memory() is None
        with pytest.raises(NotAllowed):
            profile.address(table["parameter"], store=False)
    else:
        memory = profile.memory()
        assert memory is not None
        assert profile.address(table["parameter"], store=False) == ram
        assert (memory["reason"] is not None) == table["needs_unverified"]
        store = table.get("store")
        assert (memory["means"] == "store") == (store is not None)
        if store is not None:
            assert (profile.address(memory["store_register"]), memory["store_word"]) == (
                store["address"],
                store["word"],
            )


@every_family
def test_requests_exceptions_and_codes_are_those_of_the_table(family: dict[str, Any]) -> None:
    profile = Profile.builtin(family["name"])
    assert profile.functions == family["functions"]
    assert profile.max_words == family["max_words"]
    assert profile.requests()["across_groups"] == family["across_groups"]
    for code, name in words(family["exceptions"]).items():
        assert profile.exception(code)[0] == name, f"{code:02X}"
        if name != "unknown":
            assert profile.exception_means(code) == TABLE["means"][name], f"{code:02X}"
    table = family["identification"]
    assert {row["code"]: row["family"] for row in profile.identifications()} == words(table)
    register = given(table["register"])
    assert profile.identification_address == register


def test_every_code_is_known_whichever_profile_holds_it() -> None:
    for family in FAMILIES:
        for code, name in words(family["identification"]).items():
            assert known_as(code) == {name}, f"{code:04X}"
    assert known_as(0x0110) == set()


def known_as(code: int) -> set[str]:
    """The families that some shipped profile calls the units with this code."""
    said = {Profile.builtin(name).identifies(code) for name in drivebus.profiles()}
    return {family for family in said if family is not None}


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: f"{example['family']} {example['name']}")
def test_a_value_is_that_of_the_worked_example(example: dict[str, Any]) -> None:
    profile = Profile.builtin(example["family"])
    if "variant" in example:
        [variant] = profile.variants()
        profile = profile.with_variants({variant: example["variant"]})
    low_first = example["words"][::-1] if profile.describe(example["name"]).high_first else example["words"]
    raw = sum(word << (16 * place) for place, word in enumerate(low_first))
    assert profile.decode(example["name"], raw) == float(example["value"])
    if len(example["words"]) == 1:
        assert profile.encode(example["name"], float(example["value"])) == raw
