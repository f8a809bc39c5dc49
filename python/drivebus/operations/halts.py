"""How many stops each unit of a line was given, by whichever handle: a start that takes several words ends at one."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from weakref import WeakKeyDictionary

from drivebus.operations.unit import Unit

__all__ = ["begin", "begun"]

_GIVEN: WeakKeyDictionary[object, Counter[int]] = WeakKeyDictionary()


def begin(unit: Unit) -> None:
    """A stop of *unit*, of whatever kind, is about to go out."""
    # No stop shall fail for being counted: a bus of somebody's own may be nothing that a weak reference takes.
    with suppress(TypeError):
        _GIVEN.setdefault(unit.bus.line, Counter())[unit.address] += 1


def begun(unit: Unit) -> int:
    """How many stops of *unit* have begun."""
    with suppress(TypeError):
        return _GIVEN.get(unit.bus.line, Counter())[unit.address]
    return 0
