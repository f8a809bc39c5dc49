"""Attributes and keywords must be known, or the closest is named.

`drive.setpont = 5` would be taken otherwise, and change nothing.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from inspect import get_annotations
from typing import Any, ParamSpec, TypeVar

from drivebus import checks

__all__ = ["known_keywords", "known_only"]

_T = TypeVar("_T")
_P = ParamSpec("_P")


def known_only(kind: type[_T]) -> type[_T]:
    """A class whose objects refuse public attributes that it neither has nor annotates, with the closest that it has.

    That holds for attributes that are set, and for those that are read.

    A subclass somebody writes may set what it likes, and names with an underscore are nobody's business.
    """
    annotated = {name for each in kind.__mro__ for name in get_annotations(each)}
    known = {name for name in {*annotated, *dir(kind)} if not name.startswith("_")}
    given: Any = kind.__setattr__

    def set_known(self: object, name: str, value: object) -> None:
        if type(self) is kind and name not in known and not name.startswith("_"):
            raise AttributeError(f'a {kind.__name__} has no attribute "{name}"{checks.closest(name, sorted(known))}')
        given(self, name, value)

    def get_unknown(self: object, name: str) -> Any:
        # One that is there has raised AttributeError itself: asked once more, it says why.
        if name.startswith("_") or name in known:
            return object.__getattribute__(self, name)
        raise AttributeError(f'a {type(self).__name__} has no attribute "{name}"{checks.closest(name, sorted(known))}')

    if not hasattr(kind, "__getattr__"):
        setattr(kind, "__getattr__", get_unknown)  # noqa: B010
    # Not in the class's own text, where type checkers would take it for leave to set anything.
    setattr(kind, "__setattr__", set_known)  # noqa: B010
    return kind


def known_keywords(call: Callable[_P, None]) -> Callable[_P, None]:
    """An `__init__` that names the closest keyword for one that it does not take: `baudrate` for `baud`."""
    known = call.__kwdefaults__ or {}

    @functools.wraps(call)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> None:
        for name in kwargs:
            if name not in known and name not in call.__code__.co_varnames:
                raise TypeError(f'{type(args[0]).__name__}() has no argument "{name}"{checks.closest(name, known)}')
        call(*args, **kwargs)

    return checked
