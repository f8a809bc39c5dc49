"""Every file of the corpus of `fuzz/drive.py` through its target; and the target finds what it is there to find."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from pathlib import Path

import pytest
from fuzz.drive import drive

from drivebus.operations import commands, parameter_writes
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


async def _proved_by_nothing(_: commands.Proof) -> bool:
    return True


def _sent_twice(send: Callable[..., object]) -> Callable[..., object]:
    async def twice(unit: object, name: str, *rest: object) -> None:
        await send(unit, name, *rest)  # type: ignore[misc]
        await send(unit, name, *rest)  # type: ignore[misc]

    return twice


def _sent_by_nobody(step: Callable[[Halt], Awaitable[bool]]) -> Callable[[Halt], Awaitable[bool]]:
    async def vanished(halt: Halt) -> bool:
        return halt.command == "coast" or await step(halt)

    return vanished


def found() -> Iterator[str]:
    """What the target says of the files that break its invariant."""
    for file in FILES:
        try:
            drive(file.read_bytes())
        except AssertionError as error:
            yield str(error)


def test_a_command_that_goes_out_twice_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commands, "send", _sent_twice(commands.send))
    assert any("a command went out twice" in said for said in found())


def test_a_coast_that_is_proved_by_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Halt, "step", _sent_by_nobody(Halt.step))
    monkeypatch.setattr(commands.Proof, "look", _proved_by_nothing)
    assert any("it was not halted" in said for said in found())


def test_a_write_that_is_reported_done_and_was_not_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    write = parameter_writes.write

    async def loses(unit: DriveView, run: Sequence[parameter_writes.Planned], store: bool) -> None:
        if all(item.raw <= MOST_AT_FIRST for item in run):
            await write(unit, run, store)

    monkeypatch.setattr(parameter_writes, "write", loses)
    assert any("was there" in said and "is;" in said for said in found())
