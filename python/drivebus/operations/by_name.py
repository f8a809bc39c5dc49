"""What stores, forces or reverses is given by its name: where it stands in a call nobody can read what it does.

By its place it works until 1.0, and says how it is written now.
"""

from __future__ import annotations

import functools
import inspect
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

from drivebus import checks
from drivebus.errors import level_of_the_program

__all__ = ["by_name"]

_P = ParamSpec("_P")
_R = TypeVar("_R")


def by_name(name: str, *, after: int) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Has a method, or its operation, take *name* by its place too: behind the *after* arguments that have one."""

    def named(method: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[tuple[Any, ...], dict[str, Any]]:
        # Besides them, the drive or its unit.
        if len(args) != after + 2 or name in kwargs:
            return args, kwargs
        value = args[-1]
        text = f"{method}(…, {name}={checks.shown(value)}): {name} is given by its name, from drivebus 1.0 on only so"
        warnings.warn(text, DeprecationWarning, stacklevel=level_of_the_program())
        return args[:-1], {**kwargs, name: value}

    def allow(method: Callable[_P, _R]) -> Callable[_P, _R]:
        call = cast("Callable[..., Any]", method)

        @functools.wraps(method)
        def take(*args: Any, **kwargs: Any) -> Any:
            args, kwargs = named(method.__name__, args, kwargs)
            return call(*args, **kwargs)

        @functools.wraps(method)
        async def take_awaited(*args: Any, **kwargs: Any) -> Any:
            args, kwargs = named(method.__name__, args, kwargs)
            return await call(*args, **kwargs)

        return cast("Callable[_P, _R]", take_awaited if inspect.iscoroutinefunction(method) else take)

    return allow
