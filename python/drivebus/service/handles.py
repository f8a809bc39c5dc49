"""The drives of a site on the buses of its lines."""

from __future__ import annotations

from drivebus.bus import Bus
from drivebus.drive import Drive
from drivebus.site import SiteDrive

__all__ = ["handle_of"]


def handle_of(bus: Bus, drive: SiteDrive) -> Drive:
    """*drive* on *bus*, as the file says it."""
    return bus.drive(drive.unit, drive.profile, unverified=drive.unverified, variants=drive.variants or None)
