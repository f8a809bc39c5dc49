"""Which family a unit that is to be halted may be, from the few words it was asked for, and what is asked next.

A value: answers go in, and the next question or a verdict comes out. It neither asks nor waits. How families are told
apart is decided in the core (`crates/drive`); here its names become profiles.
"""

from __future__ import annotations

from typing import NamedTuple

from drivebus import _native
from drivebus.identify.refusals import Answer
from drivebus.profile import Profile
from drivebus.profile.family import family_of

__all__ = ["Apart", "Verdict"]


class Verdict(NamedTuple):
    """What is to be done.

    Attributes:
        ask: The place to ask the unit for; None where nothing more is asked.
        take: The family to halt it as; None where none is taken.
        others: The families that it may be as well where none is taken.
    """

    ask: int | None = None
    take: Profile | None = None
    others: tuple[Profile, ...] = ()


class Apart:
    """The families that one unit may be, told apart by its answers.

    Args:
        named: What it was named as.
        trusted: Whether that is meant, whatever the unit says: then it is taken where nothing else is shown.
    """

    def __init__(self, named: Profile, *, trusted: bool = False) -> None:
        self._named = named
        self._native = _native.Apart(family_of(named), trusted)

    @property
    def is_asked(self) -> bool:
        """Whether the unit told anything yet."""
        return self._native.is_asked

    @property
    def shows_named(self) -> bool:
        """Whether the answers show a unit of what it was named as, and nothing speaks against that."""
        return self._native.shows_named

    def heard(self, answer: Answer) -> bool:
        """Takes *answer* into account. Whether it tells anything: a unit that is busy says nothing of what it is."""
        return self._native.heard(answer)

    def verdict(self, what: str | int) -> Verdict:
        """What to ask, or as what to take the unit.

        Args:
            what: The command that it is to be halted by, or the place that a word is to be written to. As what a unit
                is taken that is written to, matters only for whether that one keeps the word, or starts by it.
        """
        ask, take, others = self._native.verdict(what)
        return Verdict(ask, None if take is None else self._of(take), tuple(map(self._of, others)))

    def _of(self, name: str) -> Profile:
        # Of a name that it shares with a shipped one, the named family is the one that is meant.
        return self._named if name == self._named.name else Profile.builtin(name)
