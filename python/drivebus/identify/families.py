"""Names of families: which of them have a profile in the package, and how several stand in a sentence."""

from __future__ import annotations

from collections.abc import Iterable

from drivebus.profile import profiles

__all__ = ["all_of", "asked_as", "one_of", "shipped"]


def shipped(families: Iterable[str]) -> list[str]:
    """Those of *families* that have a profile in the package."""
    return [name for name in families if name in profiles()]


def one_of(names: Iterable[str]) -> str:
    """What may be one or the other, for people: "A, B or C"."""
    return _joined(names, "or")


def asked_as(unit: int, names: Iterable[str]) -> str:
    """How *unit* is asked for as each of *names*, for people who type it."""
    return one_of(f'bus.drive({unit}, profile="{name}") (`--profile {name}`)' for name in names)


def all_of(names: Iterable[str]) -> str:
    """What is each of several, for people: "A, B and C"."""
    return _joined(names, "and")


def _joined(names: Iterable[str], word: str) -> str:
    *others, last = dict.fromkeys(names)
    return f"{', '.join(others)} {word} {last}" if others else last
