"""Names of families: which of them have a profile in the package, and how several stand in a sentence."""

from __future__ import annotations

from collections.abc import Iterable

from drivebus.advice import Advice, Text, joined
from drivebus.profile import profiles

__all__ = ["all_of", "asked_as", "drive_as", "one_of", "shipped"]


def shipped(families: Iterable[str]) -> list[str]:
    """Those of *families* that have a profile in the package."""
    return [name for name in families if name in profiles()]


def one_of(names: Iterable[object]) -> Text:
    """What may be one or the other, for people: "A, B or C"."""
    return _joined(names, "or")


def asked_as(unit: int, names: Iterable[str]) -> Text:
    """How *unit* is asked for as each of *names*, for people who type it."""
    return one_of(drive_as(unit, name) for name in names)


def drive_as(unit: int, name: str) -> Advice:
    """How *unit* is asked for as a *name*."""
    return Advice("profile", name, f'bus.drive({unit}, profile="{name}")')


def all_of(names: Iterable[object]) -> Text:
    """What is each of several, for people: "A, B and C"."""
    return _joined(names, "and")


def _joined(names: Iterable[object], word: str) -> Text:
    return joined(dict.fromkeys(names), ", ", f" {word} ")
