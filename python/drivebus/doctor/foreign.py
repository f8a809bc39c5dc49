"""Units that answer in another protocol than Modbus: Huanyang's own, which has its CRC."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drivebus.bus import Bus
from drivebus.doctor.findings import Finding, Severity
from drivebus.errors import NoAnswer
from drivebus.identify.results import Found
from drivebus.line import huanyang
from drivebus.line_search.settings import Settings

__all__ = ["OTHER_PROTOCOL", "is_foreign", "of_drive", "speaker"]

OTHER_PROTOCOL = "other_protocol"
"""The name of the finding."""


def is_foreign(found: Found) -> bool:
    """Whether it was *found* to speak no Modbus."""
    return found.protocol != "modbus"


def of_drive(found: Found, settings: Settings) -> Finding:
    """The finding that a drive was *found* at *settings* that speaks no Modbus."""
    return Finding(
        "unit",
        OTHER_PROTOCOL,
        Severity.FAULT,
        f"unit {found.unit} answers at {settings} in {huanyang.NAME}, and not in Modbus",
        f"it is a drive of the older HY series: name it {huanyang.PROFILE}. Units for Modbus need a line of their own: "
        "what is sent to others may mean something to it",
        unit=found.unit,
        values={"protocol": found.protocol, "baudrate": settings.baudrate, "format": settings.format},
        error=NoAnswer,
    )


def speaker(bus: Bus, units: Sequence[int], tell: Callable[[str], None]) -> Finding | None:
    """The finding that one of *units*, of which none answers in Modbus, answers in Huanyang's own protocol."""
    settings = Settings.of(bus)
    for unit in units:
        tell(f"asking unit {unit} in {huanyang.NAME} at {settings}")
        for found in bus.scan([unit], protocol="huanyang"):
            return of_drive(found, settings)
    return None
