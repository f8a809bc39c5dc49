"""An operation that takes several writes: where one of them fails, the error says whether the drive took others before.

The writes of one call are counted, whoever else writes to the drive meanwhile.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, Concatenate, ParamSpec, TypeVar

from drivebus.errors import DrivebusError
from drivebus.operations.drive_view import DriveView, Taken

__all__ = ["counted", "in_parts"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


def in_parts(
    operation: Callable[Concatenate[DriveView, _P], Coroutine[Any, Any, _R]],
) -> Callable[Concatenate[DriveView, _P], Coroutine[Any, Any, _R]]:
    """Has an operation of several writes say of each error whether the drive took a part."""

    @functools.wraps(operation)
    async def whole(unit: DriveView, /, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        with counted(unit) as view:
            return await operation(view, *args, **kwargs)

    return whole


@contextmanager
def counted(unit: DriveView) -> Iterator[DriveView]:
    """A block of several writes over the view that it gives. What is a part of another is counted there."""
    if unit.taken is not None:
        yield unit
        return
    taken = Taken()
    try:
        yield unit._replace(taken=taken)
    except DrivebusError as error:
        error.in_part = taken.writes > 0
        raise
