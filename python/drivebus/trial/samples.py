"""What was recorded of a trial: one list of moments, and one list of values for each name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["Samples"]


@dataclass
class Samples:
    """Values of one drive over time. All lists are as long as `times`.

    Attributes:
        times: Seconds on the line's clock since the setpoint was moved; negative before. The middle of each exchange.
        values: One list for each name.
        units: The unit of each name; empty for what has none.
        began: Unix time in seconds of the moment 0.
    """

    times: list[float] = field(default_factory=list)
    values: dict[str, list[float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    began: float = 0.0

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, name: str) -> list[float]:
        return self.values[name]

    @property
    def interval(self) -> float | None:
        """Seconds from one sample to the next, in the mean; None for less than two."""
        return None if len(self) < 2 else (self.times[-1] - self.times[0]) / (len(self) - 1)

    def add(self, time: float, values: Mapping[str, float]) -> None:
        """One more sample."""
        self.times.append(time)
        for name, value in values.items():
            self.values.setdefault(name, []).append(value)

    def shift(self, zero: float) -> None:
        """Makes the moment *zero* the moment 0."""
        self.times = [time - zero for time in self.times]
        self.began += zero
