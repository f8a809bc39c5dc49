"""Annotations that `help` and a notebook show without quotes: `unit: int`, and not `unit: 'int'`.

Our modules are read with `from __future__ import annotations`, so that each annotation is text. What shows a signature
takes the `repr` of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import FunctionType
from typing import Any, TypeVar

__all__ = ["plain_annotations"]

_T = TypeVar("_T")


class _Plain(str):
    """Text that stands for itself where it is shown."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


def plain_annotations(what: _T) -> _T:
    """Has the annotations of a function, or of all that a class of ours has and inherits from ours, shown plainly."""
    for function in _functions(what):
        annotations = function.__annotations__
        for name, annotation in annotations.items():
            if type(annotation) is str:
                annotations[name] = _Plain(annotation)
    return what


def _functions(what: Any) -> Iterator[FunctionType]:
    if isinstance(what, FunctionType):
        yield what
        yield from _functions(getattr(what, "__wrapped__", None))
    elif isinstance(what, type):
        for owner in what.__mro__:
            if owner.__module__.partition(".")[0] != __package__:
                continue
            for member in vars(owner).values():
                function = getattr(member, "__func__", member)
                if isinstance(function, FunctionType):
                    yield from _functions(function)
