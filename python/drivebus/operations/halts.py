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
        _GIVEN.setdefault(_line_of(unit), Counter())[unit.address] += 1


def begun(unit: Unit) -> int:
    """How many stops of *unit* have begun."""
    with suppress(TypeError):
        return _GIVEN.get(_line_of(unit), Counter())[unit.address]
    return 0


def _line_of(unit: Unit) -> object:
    """What stands for the line of *unit*; the bus itself where it does not say."""
    return getattr(unit.bus, "line", unit.bus)
