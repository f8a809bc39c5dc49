"""What the operations ask of a drive and how they end, against what was noted: `tests/vectors/operations`.

It says what they did when it was noted, and not what is right: see tests/vectors/README.md.
"""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import pytest

from drivebus import Profile

from .record_operations import record
from .recorded_calls import cases_of
from .recorded_operations import FOLDER, conversations, replay
from .recorded_scenes import MISHAPS, NOTED

AT_LEAST = 2000
MOST_BYTES = 7_000_000


@pytest.mark.parametrize("family", NOTED)
def test_operations_ask_and_end_as_they_did(family: str) -> None:
    for number, conversation in enumerate(conversations(family), 1):
        try:
            replay(conversation)
        except AssertionError as error:
            told = {name: conversation.get(name) for name in ("case", "mishap", "unverified", "trusted")}
            raise AssertionError(f"{family}.jsonl, line {number}, {told}: {error}") from error


def of(family: str, case: str, mishap: str = "none") -> dict[str, Any]:
    """A conversation of *case*; the last of those that there are."""
    found = [each for each in conversations(family) if (each["case"], each["mishap"]) == (case, mishap)]
    return found[-1]


def first_write(conversation: dict[str, Any]) -> list[Any]:
    """The first step that writes."""
    steps = [step for call in conversation["calls"] for step in call["steps"]]
    return next(step for step in steps if step[0].startswith("write"))


def test_a_wish_of_which_one_digit_differs_is_noticed() -> None:
    conversation = of("gd350", "run")
    replay(conversation)
    step = first_write(conversation)
    step[0] = step[0].replace("write 2000 [0001", "write 2000 [0002")
    with pytest.raises(AssertionError, match=r"was 'write 2000 \[0002 .*is 'write 2000 \[0001 "):
        replay(conversation)


@pytest.mark.parametrize("change", ["missing", "more", "order"])
def test_so_is_one_that_is_missing_or_stands_elsewhere(change: str) -> None:
    conversation = of("gd350", "run")
    steps = conversation["calls"][0]["steps"]
    if change == "missing":
        del steps[-1]
    elif change == "more":
        steps.append(steps[-1])
    else:
        steps[-1], steps[-3] = steps[-3], steps[-1]
    with pytest.raises(AssertionError):
        replay(conversation)


def test_so_is_another_moment_where_it_counts() -> None:
    """A ramp that takes twice as long is not the one that is set in the drive, and so the stop is looked at longer."""
    conversation = of("gd350", "stop, by ramp")
    for step in conversation["calls"][0]["steps"]:
        if step[0] == "sleep 0.1":
            step[2] *= 2
    with pytest.raises(AssertionError):
        replay(conversation)


def test_so_is_another_end() -> None:
    conversation = of("gd350", "run")
    assert conversation["calls"][0]["end"] == {"result": None}
    conversation["calls"][0]["end"] = {"error": "Unconfirmed", "sent": True, "may_have_taken": True}
    with pytest.raises(AssertionError, match="it ended with"):
        replay(conversation)


def test_every_family_case_and_mishap_is_there() -> None:
    every = {family: list(conversations(family)) for family in NOTED}
    assert sum(map(len, every.values())) >= AT_LEAST
    for family, noted in every.items():
        assert {each["family"] for each in noted} == {family}
        assert {each["case"] for each in noted} == {case.name for case in cases_of(Profile.builtin(family))}
    together = Counter(each["mishap"] for noted in every.values() for each in noted)
    assert set(together) == set(MISHAPS)
    assert min(together.values()) >= 20
    assert {each.name.removesuffix(".jsonl") for each in FOLDER.iterdir()} == set(NOTED)
    assert sum(each.stat().st_size for each in FOLDER.iterdir()) < MOST_BYTES


@pytest.mark.parametrize("family", ["gd600-rectifier"])
def test_recorded_anew_it_is_the_same(family: str) -> None:
    """Of the family of which least is noted; the others are by `python -m tests.python.record_operations`."""
    anew = [json.dumps(each, separators=(",", ":")) for each in record(family)]
    assert anew == (FOLDER / f"{family}.jsonl").read_text(encoding="utf-8").splitlines()
