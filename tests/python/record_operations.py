"""Records anew what the operations ask of a drive: `python -m tests.python.record_operations [FAMILY ...]`.

It writes a file for each family in `tests/vectors/operations`, the same bytes each time. What differs afterwards is a
change of behaviour, and is to be read: see tests/vectors/README.md.
"""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from typing import Any

from drivebus import Profile
from drivebus.line.blocking import BlockingBus
from drivebus.operations.events import LOGGER

from .recorded_bus import Noting
from .recorded_calls import Case, cases_of
from .recorded_operations import FOLDER, Talk
from .recorded_scenes import COMMON, MISHAPS, NO_REQUEST, NOTED, Counts, stage_of

__all__ = ["record"]

NOTHING = "none"
"""The mishap that is none."""

TRUSTS = ((False, False), (True, False), (True, True))
"""What a program may say of a drive: `unverified`, and that its profile is trusted."""

OF_ITS_OWN, ALIKE = (5, 11), (13, 29)
"""Every how many pairs of case and mishap a family has one: where the mishap is common, and where it is not. The pairs
take turns. A family that is told what another one is, or nothing, has fewer."""

FULLEST = "gd350"
"""The family that has every operation."""

OF_FEW = (
    "fault history",
    "write",
    "write, several",
    "write, at rest",
    "write, stored",
    "write and store",
    "time-out",
    "inputs",
    "outputs",
    "set virtual inputs",
    "set virtual outputs",
    "special control",
)
"""Cases that few families can have: of the fullest each of them is noted under each common mishap."""

LONGEST = 60
"""Most steps of a conversation under a mishap: longer ones are many looks at the same."""

AT_ONCE = 4
"""Families that are recorded side by side: each mostly waits for the threads of its simulator."""


def noted(
    family: str, case: Case, mishap: str, counts: Counts, *, unverified: bool, trusted: bool
) -> tuple[dict[str, Any], Counts]:
    """The conversation of *case* under *mishap*, and how many requests it had; without it, it had *counts*."""
    how = MISHAPS[mishap]
    stands = case.stands if how.stands == "ready" else how.stands
    conversation: dict[str, Any] = {"family": family, "case": case.name, "mishap": mishap}
    conversation |= {"unverified": True} if unverified else {}
    conversation |= {"trusted": True} if trusted else {}
    with ExitStack() as left:
        stage = stage_of(family, stands, how.other, f"{family}, {case.name}, {mishap}", left)
        if how.put is not None:
            how.put(stage, counts)
        bus = Noting(BlockingBus(stage.bus), stage.simulator.now, stage.before, stage.after)
        talk = Talk(bus, family, unverified=unverified, trusted=trusted)
        conversation["calls"] = []
        for call in case.calls:
            steps = bus.begin()
            end = talk.end_of(call.do, call.given)
            given = {"with": call.given} if call.given else {}
            conversation["calls"].append({"do": call.do, **given, "steps": steps, "end": end})
        return conversation, stage.counts


def turn_of(family: str) -> tuple[int, tuple[int, int]]:
    """Which family of its kind it is, and how often one of that kind has a pair."""
    groups: dict[bool, list[str]] = {True: [], False: []}
    words: list[dict[str, tuple[int, int]]] = [{}]
    for name in NOTED:
        profile = Profile.builtin(name)
        told = {command: profile.command(command) for command in profile.commands()}
        groups[told not in words].append(name)
        words.append(told)
    is_own = family in groups[True]
    return groups[is_own].index(family), OF_ITS_OWN if is_own else ALIKE


def record(family: str) -> Iterator[dict[str, Any]]:
    """What is noted of *family*: each case without a mishap, and with those whose turn it is.

    What is as it was under another trust, or without the mishap, is left out.
    """
    names = list(MISHAPS)
    number, rates = turn_of(family)
    for place, case in enumerate(cases_of(Profile.builtin(family))):
        seen: set[str] = set()
        counted: list[Counts] = []
        turns = [(NOTHING, trust) for trust in range(len(TRUSTS))]
        for mishap in names[1:]:
            is_common = mishap in COMMON
            every = rates[0 if is_common else 1]
            turn = number + 7 * place + 3 * names.index(mishap)
            if turn % every == 0 or (is_common and family == FULLEST and case.name in OF_FEW):
                turns.append((mishap, turn // every))
        for mishap, turn in turns:
            # What is refused for want of trust before anything is sent, meets no mishap.
            having = [trust for trust, counts in enumerate(counted) if counts.requests] or [0]
            trust = turn if mishap == NOTHING else having[turn % len(having)]
            counts = NO_REQUEST if mishap == NOTHING else counted[trust]
            if MISHAPS[mishap].is_of_writes and counts.first_write is None:
                continue
            unverified, trusted = TRUSTS[trust]
            conversation, had = noted(family, case, mishap, counts, unverified=unverified, trusted=trusted)
            if mishap == NOTHING:
                counted.append(had)
            calls = json.dumps(conversation["calls"])
            is_short = sum(len(call["steps"]) for call in conversation["calls"]) <= LONGEST
            if calls not in seen and (is_short or mishap == NOTHING):
                seen.add(calls)
                yield conversation


def write(family: str) -> None:
    """Records *family* into its file."""
    lines = [json.dumps(each, separators=(",", ":")) for each in record(family)]
    (FOLDER / f"{family}.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def quiet() -> None:
    """What happens to drives is not told on the terminal."""
    logging.getLogger(LOGGER).addHandler(logging.NullHandler())


def main(families: list[str]) -> None:
    """Records *families*, or all of them where none is named."""
    FOLDER.mkdir(exist_ok=True)
    with ProcessPoolExecutor(AT_ONCE, initializer=quiet) as workers:
        for _done in workers.map(write, families or NOTED):
            pass


if __name__ == "__main__":
    main(sys.argv[1:])
