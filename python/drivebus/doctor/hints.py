"""Hints: what the figures of all that was asked most likely mean, where that is not found otherwise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import BadAnswer, NoAnswer

__all__ = ["hint_findings"]

_HINTS: Mapping[str, tuple[Severity, type[BadAnswer | NoAnswer] | None]] = {
    "no_bias": (Severity.WARNING, BadAnswer),
    "interference": (Severity.WARNING, BadAnswer),
    "other_master": (Severity.FAULT, BadAnswer),
    "other_answers": (Severity.WARNING, BadAnswer),
    "timeout_too_short": (Severity.WARNING, NoAnswer),
    "settings_changed": (Severity.WARNING, NoAnswer),
    "adapter_echo": (Severity.NOTE, None),
}
"""Hints of `Bus.stats` that say more than what was found otherwise. Silence and damage are counted by unit."""


def hint_findings(bus: Bus) -> Iterator[Finding]:
    """What the figures of *bus* most likely mean."""
    stats = bus.stats()
    for name, text in zip(stats["hint_names"], stats["hints"], strict=True):
        if name in _HINTS:
            severity, error = _HINTS[name]
            yield Finding("line", name, severity, text.removeprefix("line: "), error=error)
