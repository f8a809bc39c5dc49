"""One unit as one call sees it, and what is remembered of it between calls."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

from drivebus import checks
from drivebus.identify.same_unit import SameUnit
from drivebus.line.protocols import AwaitableBus
from drivebus.profile import Profile
from drivebus.profile.evidence import Evidence
from drivebus.values import State

__all__ = ["Memory", "Unit"]


@dataclass(slots=True)
class Memory:
    """What a drive's handle keeps between calls. Every view of its unit shares it.

    Attributes:
        identity: What it said it is, and since when that is known.
        last_state: The state that was seen last, in words, and when on the line's clock.
        in_ram: Parameters that were written to RAM and not to EEPROM since: what they read as is then not stored.
        stores: How often each parameter was written to EEPROM.
        starts: How many starts were sent, or were about to be.
        halts: How many stops have gone out, of whatever kind.
        started_as: How it was started here last; unknown after a jog or a raw write. None: it was not.
        started_unverified: Whether it was started by what is not verified, and so may be stopped by that.
    """

    identity: SameUnit
    last_state: tuple[str, float] | None = None
    in_ram: set[str] = field(default_factory=set)
    stores: Counter[str] = field(default_factory=Counter)
    starts: int = 0
    halts: int = 0
    started_as: State | None = None
    started_unverified: bool = False


@dataclass(frozen=True, slots=True)
class Unit:
    """One unit as one call sees it. Another bus or more trust make another view of the same memory.

    Attributes:
        bus: The line it hangs on.
        address: 1..247.
        evidence: Its profile, under one trust.
        memory: What is kept of it between calls.
    """

    bus: AwaitableBus
    address: int
    evidence: Evidence
    memory: Memory

    @classmethod
    def at(
        cls,
        bus: AwaitableBus,
        address: int,
        profile: Profile,
        identification: int | None,
        *,
        unverified: bool,
        trust_profile: bool,
    ) -> Unit:
        """The unit at *address*, of which nothing is remembered but its *identification*, if it was asked for that."""
        trusted = checks.flag("trust_profile", trust_profile)
        identity = SameUnit(bus, address, profile, identification, trusted=trusted)
        evidence = Evidence(profile, address, checks.flag("unverified", unverified))
        return cls(bus, address, evidence, Memory(identity))

    @property
    def profile(self) -> Profile:
        """What its words mean."""
        return self.evidence.profile

    @property
    def unverified(self) -> bool:
        """Whether what no document of its family proves is done all the same."""
        return self.evidence.unverified

    def over(self, bus: AwaitableBus) -> Unit:
        """The same unit over another face of the same line."""
        return replace(self, bus=bus)

    def trusting(self, unverified: bool) -> Unit:
        """The same unit; if *unverified*, what is not verified is done all the same."""
        if not checks.flag("unverified", unverified) or self.unverified:
            return self
        return replace(self, evidence=self.evidence.trusting(True))

    def under(self, profile: Profile) -> Unit:
        """The same unit, whose words are known better: by *profile*."""
        return replace(self, evidence=self.evidence.of(profile))
