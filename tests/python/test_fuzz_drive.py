"""Every file of the corpus of `fuzz/drive.py` through its target; and the target finds what it is there to find."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from fuzz.drive import drive

from drivebus.operations import core_calls, motion, parameters
from drivebus.operations.drive_view import DriveView
from drivebus.operations.halting import Halt

CORPUS = Path(__file__).parents[2] / "fuzz" / "corpus" / "drive"
FILES = sorted(CORPUS.iterdir())
MOST_AT_FIRST = 10  # the greatest word that a drive is made ready with


@pytest.mark.parametrize("file", FILES, ids=[file.name for file in FILES])
def test_the_corpus_breaks_nothing(file: Path) -> None:
    drive(file.read_bytes())


def test_the_corpus_is_there() -> None:
    assert len(FILES) >= 10


def _done_twice(do: Callable[..., Awaitable[tuple[str, Any]]]) -> Callable[..., Awaitable[tuple[str, Any]]]:
    async def twice(unit: object, wanted: object) -> tuple[str, Any]:
        await do(unit, wanted)
        return await do(unit, wanted)

    return twice


def found() -> Iterator[str]:
    """What the target says of the files that break its invariant."""
    for file in FILES:
        try:
            drive(file.read_bytes())
        except AssertionError as error:
            yield str(error)


def test_a_command_that_goes_out_twice_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "call_core", _done_twice(core_calls.call_core))
    assert any("a command went out twice" in said for said in found())


def test_a_coast_that_is_proved_by_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    begin, carry_out = Halt.__init__, Halt.carry_out
    coasts: list[Halt] = []

    def begins(halt: Halt, unit: DriveView, command: str, *rest: float, **more: bool) -> None:
        begin(halt, unit, command, *rest, **more)
        if command == "coast":
            coasts.append(halt)

    async def vanishes(halt: Halt) -> None:
        if halt not in coasts:
            await carry_out(halt)

    monkeypatch.setattr(Halt, "__init__", begins)
    monkeypatch.setattr(Halt, "carry_out", vanishes)
    assert any("it was not halted" in said for said in found())


def test_a_write_that_is_reported_done_and_was_not_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    write = parameters.write

    async def loses(unit: DriveView, name: str | Mapping[str, object], value: object = None, **how: bool) -> None:
        wanted = name if isinstance(name, Mapping) else {name: value}
        if all(unit.profile.encode(each, given) <= MOST_AT_FIRST for each, given in wanted.items()):
            await write(unit, wanted, **how)

    monkeypatch.setattr(parameters, "write", loses)
    assert any("was there" in said and "is;" in said for said in found())
