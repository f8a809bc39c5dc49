"""Attributes that are set must be known: `drive.setpont = 5` would be taken otherwise, and change nothing."""

from __future__ import annotations

from inspect import get_annotations
from typing import Any, TypeVar

from drivebus import checks

__all__ = ["known_only"]

_T = TypeVar("_T")


def known_only(kind: type[_T]) -> type[_T]:
    """A class whose objects refuse public attributes that it neither has nor annotates, with the closest that it has.

    A subclass somebody writes may set what it likes, and names with an underscore are nobody's business.
    """
    annotated = {name for each in kind.__mro__ for name in get_annotations(each)}
    known = {name for name in {*annotated, *dir(kind)} if not name.startswith("_")}
    given: Any = kind.__setattr__

    def set_known(self: object, name: str, value: object) -> None:
        if type(self) is kind and name not in known and not name.startswith("_"):
            raise AttributeError(f'a {kind.__name__} has no attribute "{name}"{checks.closest(name, sorted(known))}')
        given(self, name, value)

    # Not in the class's own text, where type checkers would take it for leave to set anything.
    setattr(kind, "__setattr__", set_known)  # noqa: B010
    return kind
