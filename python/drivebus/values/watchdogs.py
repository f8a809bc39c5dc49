"""Which parameters make a drive act when its bus falls silent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["WatchdogSettings"]


@dataclass(frozen=True)
class WatchdogSettings:
    """Which parameters make a drive act by itself when its bus falls silent.

    Attributes:
        timeout: The parameter that holds how long the bus may be silent.
        action: The parameter that holds what the drive then does; None: it trips, and what the fault does to the motor
            is set elsewhere in the drive.
        actions: The value of *action* for each thing it can do: `"coast"`, `"stop"`, `"trip"`. Without one for a trip
            alone, a coast trips the fault, too.
        verified: Whether a document of this very family prints them.
        source: The document that says so.
        note: What else is known; says what is assumed where it is not verified.
        fault: The number of the fault that it trips, or None.
    """

    timeout: str
    action: str | None
    actions: Mapping[str, int]
    verified: bool
    source: str
    note: str = ""
    fault: int | None = None

    @property
    def choices(self) -> tuple[str, ...]:
        """What `Drive.watchdog` can have the drive do: `"coast"`, `"stop"`, `"trip"`."""
        return tuple(self.actions) if self.action is not None else ("trip",)
