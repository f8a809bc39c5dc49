"""What was found out about a unit that nobody knew. Plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

__all__ = ["Certainty", "Found", "Identification", "Protocol"]

Certainty: TypeAlias = Literal["certain", "shared", "unverified", "by answers", "unknown"]
"""How sure it is what a unit is; see `Identification`."""

Protocol: TypeAlias = Literal["modbus", "huanyang"]
"""What a unit speaks: Modbus RTU, or its maker's own protocol."""


@dataclass(frozen=True)
class Found:
    """A unit that answered a scan.

    Attributes:
        unit: Its address, 1..247.
        profile: The family it was identified as; None if it is unknown or would not tell.
        identification: Its identification code; None if it would not tell.
        round_trip: Seconds from the request's first bit to the answer's last.
        problem: What was wrong with its answer, or None.
        certainty: How sure that family is, as `Identification.certainty` says it.
        candidates: The families that it may be.
        protocol: `"modbus"`, or `"huanyang"` where it answers in that maker's own protocol.
    """

    unit: int
    profile: str | None
    identification: int | None
    round_trip: float
    problem: str | None = None
    certainty: Certainty = "unknown"
    candidates: tuple[str, ...] = ()
    protocol: Protocol = "modbus"


@dataclass(frozen=True)
class Identification:
    """What a unit is, as far as it tells.

    Attributes:
        unit: Its address, 1..247.
        candidates: The families that it may be, by the names of their profiles.
        family: The one, if there is only one.
        code: The identification code that it gave; None if it gave none.
        title: What the unit is called by its maker, or what it may be; empty if nothing is known.
        certainty: `"certain"`: a code that documents print for the family, and nobody else reports. `"shared"`: a code
            that several report. `"unverified"`: a code that no document prints. `"by answers"`: no code, but it answers
            and refuses the words that such a unit does. `"unknown"`.
        reason: The same in words.
    """

    unit: int
    candidates: tuple[str, ...]
    family: str | None
    code: int | None
    title: str
    certainty: Certainty
    reason: str

    def __str__(self) -> str:
        return f"unit {self.unit}: {self.title or 'not known'} ({self.certainty}: {self.reason})"
