"""One drive as one call sees it: a view of what its line knows of it, in the words of one profile."""

from __future__ import annotations

from typing import NamedTuple

from drivebus import checks
from drivebus.identify.same_unit import SameUnit
from drivebus.line.protocols import AwaitableBus
from drivebus.line.units import UnitRecord, units_of
from drivebus.profile import Profile
from drivebus.profile.evidence import Evidence

__all__ = ["DriveView", "Taken"]


class Taken:
    """What the drive took of one call.

    Attributes:
        writes: How many writes it confirmed.
    """

    __slots__ = ("writes",)

    def __init__(self) -> None:
        self.writes = 0


class DriveView(NamedTuple):
    """One drive as one call sees it. Another bus or more trust make another view of the same record.

    Attributes:
        bus: The bus of its line.
        address: 1..247.
        evidence: Its profile, under one trust.
        record: What the line knows of it.
        identity: Whether it is what its profile says, and still the one it was.
        taken: What the drive took of the call that this view was made for, where that is counted.
    """

    bus: AwaitableBus
    address: int
    evidence: Evidence
    record: UnitRecord
    identity: SameUnit
    taken: Taken | None = None

    @classmethod
    def create(
        cls,
        bus: AwaitableBus,
        address: int,
        profile: Profile,
        identification: int | None,
        *,
        unverified: bool,
        trust_profile: bool,
    ) -> DriveView:
        """The unit at *address*, which gave the code *identification*, if it was asked for that."""
        # A line of somebody's own may not say what stands for it.
        record = units_of(getattr(bus, "line", bus)).record(address)
        identity = SameUnit(bus, record, profile, identification, trusted=checks.flag("trust_profile", trust_profile))
        return cls(bus, address, Evidence(profile, address, checks.flag("unverified", unverified)), record, identity)

    @property
    def profile(self) -> Profile:
        """What its words mean."""
        return self.evidence.profile

    @property
    def unverified(self) -> bool:
        """Whether what no document of its family proves is done all the same."""
        return self.evidence.unverified

    def with_bus(self, bus: AwaitableBus) -> DriveView:
        """The same unit over another face of the same line."""
        return self._replace(bus=bus)

    def trusting(self, unverified: bool) -> DriveView:
        """The same unit; if *unverified*, what is not verified is done all the same."""
        if not checks.flag("unverified", unverified) or self.unverified:
            return self
        return self._replace(evidence=self.evidence.trusting(True))

    def taken_for(self, profile: Profile) -> DriveView:
        """The same unit, which shows that it is of *profile* and not what it was named as; trusted as that."""
        identity = SameUnit(self.bus, self.record, profile)
        return self._replace(evidence=Evidence(profile, self.address, True), identity=identity)

    def with_profile(self, profile: Profile) -> DriveView:
        """The same unit, whose words are known better: by *profile*."""
        return self._replace(evidence=self.evidence.of(profile))
