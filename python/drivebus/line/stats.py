"""How a line and its units do: how well one is reached, and what was counted.

Plain data: nothing here reads from a line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from drivebus.named import Named

__all__ = ["Link", "Stats", "noisy"]


@dataclass(frozen=True)
class Link:
    """How well one unit could be reached: its last exchanges, ten at most.

    Attributes: *good*, how many of them brought an answer (a refusal is one), and *asked*, how many there were.
    """

    good: int
    asked: int

    @property
    def failed(self) -> int:
        """How many of them brought no answer, or a damaged one."""
        return self.asked - self.good

    def __str__(self) -> str:
        return f"{self.good} of the last {self.asked} exchanges brought an answer"


def noisy(stats: Mapping[str, Any]) -> list[int]:
    """The units of whom bytes came, by the figures in *stats*, and all of them were no answer."""

    def is_noise(figures: Mapping[str, int]) -> bool:
        came = figures["noise_bytes"] + figures["crc_errors"] + figures["bad_answers"]
        return bool(came) and not figures["answers"] and not figures["refusals"]

    return [unit for unit, figures in stats["units"].items() if is_noise(figures)]


class Stats(Named[Any]):
    """Counters and latencies: a mapping whose names are attributes too, nested where it is per unit.

    Counters are ints, latencies seconds. `stats.answers`, `stats.units[1].timeouts`.
    """

    __slots__ = ()

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__(
            {key: Stats.nested(value) if isinstance(value, Mapping) else value for key, value in values.items()}
        )

    @staticmethod
    def nested(values: Mapping[Any, Any]) -> Any:
        """A mapping by name becomes `Stats`; one by unit stays a dict of `Stats`."""
        if all(isinstance(key, str) for key in values) and values:
            return Stats(values)
        return {key: Stats(value) if isinstance(value, Mapping) else value for key, value in values.items()}

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value!r}" for name, value in self.items())
        return f"Stats({shown})"
