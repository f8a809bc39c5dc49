"""What a search finds, and how far it has come. Plain data."""

from __future__ import annotations

from dataclasses import dataclass

from drivebus.identify.profile_choice import usable
from drivebus.identify.results import Identification
from drivebus.line_search.settings import Settings

__all__ = ["Located", "Progress"]


@dataclass(frozen=True)
class Located:
    """A unit that answered a search.

    Attributes:
        settings: At which it did: `drivebus.Bus(port, **vars(located.settings))` opens the line so.
        unit: Its address, 1..247.
        identification: What it says that it is; None if no answer of it was whole.
        problem: What was wrong with its answers, if none was whole; that it speaks another protocol; else None.
        protocol: In what it answered: `"modbus"`, or `"huanyang"`: the maker's own, which `huanyang-hy` speaks.
    """

    settings: Settings
    unit: int
    identification: Identification | None
    problem: str | None = None
    protocol: str = "modbus"

    @property
    def profile(self) -> str | None:
        """The family it was identified as, or None."""
        known = self.identification
        return None if known is None else usable(known, unverified=True) or known.family

    @property
    def certainty(self) -> str:
        """How sure the family is, as `Identification.certainty` says it."""
        return "unknown" if self.identification is None else self.identification.certainty

    def __str__(self) -> str:
        known = self.identification
        what = self.problem if known is None else f"{known.title or 'not known'} ({known.certainty}: {known.reason})"
        return f"unit {self.unit} at {self.settings}: {what}"


@dataclass(frozen=True)
class Progress:
    """How far a search has come.

    Attributes:
        settings: What is tried.
        unit: Who is asked, 1..247; None while the line is listened to.
        left: Seconds until all that is planned is asked, if nobody answers any more.
    """

    settings: Settings
    unit: int | None
    left: float
