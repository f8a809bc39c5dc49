"""Operations of the core, carried out over a bus: what a task wishes for is asked, and it is told what came of that.

Each wish and what came of it is a record of level DEBUG of the logger `drivebus.operations`.
"""

from __future__ import annotations

import sys
from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from typing import Any, TypeAlias

from drivebus._native import Task
from drivebus.errors import DrivebusError
from drivebus.line.asking import Ask, Read, Stamped, Write
from drivebus.line.protocols import AwaitableBus, AwaitsHalts

__all__ = ["LOGGER", "carried_out", "carried_out_by"]

LOGGER = "drivebus.operations"

_Outcome: TypeAlias = "list[int] | Stamped | tuple[int | None, ...] | DrivebusError | None"
_Around: TypeAlias = Callable[[], AbstractContextManager[None]]
_Hears: TypeAlias = Callable[[str, Any], None]


def _deaf(_: str, __: object) -> None:
    """Hears no notice."""


async def carried_out(task: Task, bus: AwaitableBus, around: _Around = nullcontext, hears: _Hears = _deaf) -> Any:
    """What *task* comes to over *bus*.

    What interrupts a wish, as Ctrl-C and a cancellation do, goes through: then the task ends where it stands.

    Args:
        task: It has not begun.
        bus: Who is asked.
        around: A block of its own around each request.
        hears: Who is told its notices: of which kind, and what of it.

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
        if kind == "sleep":
            outcome = await _outcome_of(bus.sleep, told, nullcontext)
        elif kind == "read":
            outcome = await _outcome_of(bus.ask, Read(*told), around)
        elif kind == "stamped":
            outcome = await _outcome_of(bus.ask_stamped, Read(*told), around)
        elif kind == "write":
            outcome = await _outcome_of(bus.ask, Write(*told), around)
        elif kind == "link":
            outcome = await _outcome_of(partial(_link, bus), told, nullcontext)
        elif kind == "halts":
            outcome = await _outcome_of(partial(_halts, bus), told, nullcontext)
        else:
            hears(kind, told)


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
        outcome = await _outcome_of(ask, Read(*told), nullcontext)


async def _link(bus: AwaitableBus, unit: int) -> tuple[int, int]:
    """How many of the last exchanges with *unit* brought an answer, and how many there were."""
    link = await bus.link(unit)
    return link.good, link.asked


async def _halts(bus: AwaitableBus, unit: int) -> tuple[int | None]:
    """How often *unit* was told to halt, where the line counts that."""
    return (await bus.halts(unit) if isinstance(bus, AwaitsHalts) else None,)


async def _outcome_of(do: Callable[[Any], Awaitable[Any]], what: object, around: _Around) -> _Outcome:
    """What comes of *what*, errors included. They know this frame, and not that of whoever keeps them."""
    try:
        with around():
            outcome: list[int] | Stamped | tuple[int | None, ...] | None = await do(what)
    except DrivebusError as error:
        _tell(what, f"{type(error).__name__}: {error}")
        return error
    _tell(what, outcome)
    return outcome


def _tell(wish: object, outcome: object) -> None:
    """Tells what came of a *wish*. Who never imported `logging` does not want its records."""
    logging = sys.modules.get("logging")
    if logging is None:
        return
    logger = logging.getLogger(LOGGER)
    if logger.isEnabledFor(logging.DEBUG):
        wanted = f"wait {wish:g} s" if isinstance(wish, float) else wish
        logger.debug("%s -> %s", wanted, "done" if outcome is None else outcome)
