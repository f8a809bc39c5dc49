"""One call of the core to a unit: carried out over its line, with what comes about kept and told.

What is sent, and what proves it, is decided in the core (`crates/drive`). Of what came to nothing it gives the kind of
the reason and what is told of it; who asked has the words.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from drivebus import _native
from drivebus.line.tasks import carried_out
from drivebus.operations import events, glances, kept, other_words
from drivebus.operations.drive_view import DriveView
from drivebus.operations.explained import explained
from drivebus.operations.program_end import before_start
from drivebus.operations.said import said
from drivebus.values import State

__all__ = ["call_core", "hear"]


async def call_core(unit: DriveView, wanted: Callable[[_native.Unit], _native.Task]) -> tuple[str, Any]:
    """What *wanted* comes to with *unit*: `"done"` and its result, or a kind of reason and what is told of it.

    What the unit took of it is counted, whatever it comes to.

    Raises:
        DrivebusError: As the bus raised it, for what the core does not handle.
    """
    same, looks = unit.identity.seen_as(unit.profile), glances.planned(unit.evidence).looks
    core = _native.Unit(same, looks, unit.record.sent)
    task = wanted(core)

    def around() -> AbstractContextManager[None]:
        return nullcontext() if task.taken_for is None else explained(unit)

    def hears(kind: str, told: Any) -> None:
        hear(unit, kind, told)

    try:
        kind, told = await carried_out(task, unit.bus, around, hears)
    finally:
        if unit.taken is not None:
            unit.taken.writes += core.parts
    return kind, told


def hear(unit: DriveView, kind: str, told: Any) -> None:
    """Keeps what the core tells of *unit*, and tells it on. Before a start, whoever may forbid that is asked."""
    if kind == "took":
        events.took(unit, said(told))
    elif kind == "saw":
        glances.keep(unit, glances.shown(unit, told))
    elif kind == "shows":
        glances.remember(unit, str(State(told)))
    elif kind == "took_other":
        command, word, otherwise = told
        other_words.took(unit, said(command), word, other_words.SetOtherwise(*otherwise))
    elif kind == "stored":
        kept.warn_of_wear(unit, *told)
    else:
        before_start()
        unit.record.started_under = unit.profile
