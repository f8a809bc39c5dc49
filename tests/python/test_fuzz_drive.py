"""Every file of the corpus of `fuzz/drive.py` through its target; and the target finds what it is there to find."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fuzz.drive import drive

from drivebus import commanding, motion, parameters

CORPUS = Path(__file__).parents[2] / "fuzz" / "corpus" / "drive"
FILES = sorted(CORPUS.iterdir())
MOST_AT_FIRST = 10  # the greatest word that a drive is made ready with


@pytest.mark.parametrize("file", FILES, ids=[file.name for file in FILES])
def test_the_corpus_breaks_nothing(file: Path) -> None:
    drive(file.read_bytes())


def test_the_corpus_is_there() -> None:
    assert len(FILES) >= 10


async def _proved_by_nothing(*_: object, **__: object) -> None:
    return


def _sent_twice(send: Callable[..., object]) -> Callable[..., object]:
    async def twice(self: object, name: str, *rest: object) -> None:
        await send(self, name, *rest)  # type: ignore[misc]
        await send(self, name, *rest)  # type: ignore[misc]

    return twice


def _sent_by_nobody(send: Callable[..., object]) -> Callable[..., object]:
    async def vanished(self: object, name: str, *rest: object) -> None:
        if name != "coast":
            await send(self, name, *rest)  # type: ignore[misc]

    return vanished


def found() -> Iterator[str]:
    """What the target says of the files that break its invariant."""
    for file in FILES:
        try:
            drive(file.read_bytes())
        except AssertionError as error:
            yield str(error)


def test_a_command_that_goes_out_twice_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commanding.Commanding, "_command", _sent_twice(commanding.Commanding._command))
    assert any("a command went out twice" in said for said in found())


def test_a_coast_that_is_proved_by_nothing_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commanding.Commanding, "_command", _sent_by_nobody(commanding.Commanding._command))
    monkeypatch.setattr(motion.Motion, "_confirm", _proved_by_nothing)
    assert any("it was not halted" in said for said in found())


def test_a_write_that_is_reported_done_and_was_not_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    write = parameters.Parameters._write_one

    async def loses(self: parameters.Parameters, item: Any, store: bool) -> None:
        if item.raw <= MOST_AT_FIRST:
            await write(self, item, store)

    monkeypatch.setattr(parameters.Parameters, "_write_one", loses)
    assert any("was there" in said and "is;" in said for said in found())
