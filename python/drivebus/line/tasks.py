"""Operations of the core, carried out over a bus: what a task wishes for is asked, and it is told what came of that."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, TypeAlias

from drivebus._native import Task
from drivebus.errors import DrivebusError
from drivebus.line.asking import Ask, Read
from drivebus.line.protocols import AwaitableBus

__all__ = ["carried_out", "carried_out_by"]

_Outcome: TypeAlias = "list[int] | DrivebusError | None"


async def carried_out(task: Task, bus: AwaitableBus) -> Any:
    """What *task* comes to over *bus*.

    What interrupts a wish, as Ctrl-C and a cancellation do, goes through: then the task ends where it stands.

    Raises:
        DrivebusError: Those of the task, and those of *bus* that it does not handle, as they are.
    """
    outcome: _Outcome = None
    while True:
        try:
            kind, told = task.step(bus.now(), bus.reconnects, bus.closed, outcome)
        finally:
            # An error that comes back here knows this frame, which must not know it.
            outcome = None
        if kind == "done":
            return told
        outcome = await (_outcome_of(bus.ask, Read(*told)) if kind == "read" else _outcome_of(bus.sleep, told))


async def carried_out_by(task: Task, ask: Ask) -> Any:
    """What *task* comes to, which only reads and looks at no clock, where *ask* asks. As `carried_out`."""
    outcome: _Outcome = None
    while True:
        try:
            kind, told = task.step(0.0, 0, False, outcome)
        finally:
            outcome = None
        if kind == "done":
            return told
        outcome = await _outcome_of(ask, Read(*told))


async def _outcome_of(do: Callable[[Any], Awaitable[Any]], what: object) -> _Outcome:
    """What comes of *what*, errors included. They know this frame, and not that of whoever keeps them."""
    try:
        outcome: list[int] | None = await do(what)
    except DrivebusError as error:
        return error
    return outcome
