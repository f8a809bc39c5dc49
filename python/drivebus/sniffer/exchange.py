"""One exchange on a line that others use: a request and what came of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from drivebus.errors import DrivebusError
from drivebus.values import Value

__all__ = ["Exchange"]


@dataclass(frozen=True, slots=True)
class Exchange:
    """A request that was heard and what came of it, or something that belongs to none.

    Moments are those at which bytes were handed over. Behind an adapter that collects them they tell no more than that:
    `lump` says how long yours does.

    Attributes:
        unit: Who was asked, 1..247; 0 for all; None where it is not known.
        request: The whole frame; None of what answers no request that was heard.
        answer: The whole frame; None where none came.
        values: What was read or written, by the names of the unit's family; by addresses where no family is known.
        time: Unix time in seconds at which the first of it began.
        gap: Seconds since the end of what was heard before it; None of the first.
        turnaround: Seconds from the end of the request to the start of its answer; None where there is none.
        answered: Unix time in seconds at which its answer had come; None where there is none.
        error: What went wrong, as an error that is not raised: `NoAnswer`, `Refused`, or `BadAnswer` with the bytes in
            `raw`. None of an exchange that is whole.
        profile: The name of the family that its values were read by; None where none is known.
        repeated: How often the same request had been sent before it without an answer.
        lump: Seconds that the adapter kept bytes back, as far as that has shown.
        protocol: `"modbus"`, or `"huanyang"`: the maker's own one, which has the same CRC.
    """

    unit: int | None
    request: bytes | None
    answer: bytes | None
    time: float
    gap: float | None
    turnaround: float | None
    error: DrivebusError | None
    answered: float | None = None
    values: Mapping[str | int, Value] = field(default_factory=lambda: MappingProxyType({}))
    profile: str | None = None
    repeated: int = 0
    lump: float = 0.0
    protocol: str = "modbus"

    @property
    def function(self) -> int | None:
        """The function that is asked for, 1..127; None where there is no frame."""
        frame = self.request or self.answer
        return None if frame is None else frame[1] & 0x7F
