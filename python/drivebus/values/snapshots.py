"""Values that were read together."""

from __future__ import annotations

from collections.abc import Mapping

from drivebus.attribute_mapping import Named
from drivebus.values.choices import Value

__all__ = ["Snapshot"]


class Snapshot(Named[str, Value]):
    """Values read together: a mapping whose names are attributes too.

    Attributes:
        time: Unix time in seconds at which the first request left.
        duration: Seconds until the last answer was complete.
        units: Engineering unit of each name.
    """

    __slots__ = ("duration", "time", "units")

    def __init__(self, values: Mapping[str, Value], units: Mapping[str, str], time: float, duration: float) -> None:
        super().__init__(values)
        self.units = dict(units)
        self.time = time
        self.duration = duration

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value} {self.units[name]}".rstrip() for name, value in self.items())
        return f"Snapshot({shown})"
