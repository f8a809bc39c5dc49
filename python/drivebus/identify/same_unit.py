"""Whether the unit at an address is what it was named as, and still the one it was.

People name a profile, and mistake one drive for another. So what the unit says of itself is asked before anything goes
out that moves a motor or changes a value, and where it speaks against the profile, nothing goes out.

A port that was lost and opened again may be another one: an adapter plugged in elsewhere, a cable moved to another
machine, where the same address is another drive. So it is asked again then. A stop waits for it only
where its word may start a drive of another family.

What is asked, and what the answers mean, is decided in the core (`crates/drive`); here are the words for it.
"""

from __future__ import annotations

from typing import Any

from drivebus import _native
from drivebus.advice import Text
from drivebus.errors import DrivebusError, WrongDrive
from drivebus.identify.contradiction import in_words
from drivebus.line.protocols import AwaitableBus
from drivebus.line.tasks import carried_out
from drivebus.line.units import UnitRecord
from drivebus.profile import Profile
from drivebus.profile.family import family_of

__all__ = ["SameUnit"]


class SameUnit:
    """Makes sure that the unit at an address is what it was named as, and still the one it was.

    Args:
        bus: The line it hangs on; only for how often that was opened again.
        record: What is known of it, which its other handles see too.
        profile: What it was named as.
        code: What it said, if it was asked before.
        trusted: Whether the profile is believed, whatever the unit says.

    Attributes:
        trusted: The same.
    """

    def __init__(
        self,
        bus: AwaitableBus,
        record: UnitRecord,
        profile: Profile,
        code: int | None = None,
        *,
        trusted: bool = False,
    ) -> None:
        self._unit = record.address
        self._profile = profile
        self.trusted = trusted
        self._identity = record.identity(profile, bus.reconnects)
        if code is not None:
            self.seen_as(profile).gave(code, bus.now())

    def seen_as(self, profile: Profile) -> _native.SameUnit:
        """The same for the core, where its words are known better: by *profile*."""
        return _native.SameUnit(self._unit, family_of(profile), self._identity, self.trusted)

    async def check(self, bus: AwaitableBus, *, judged: bool = True, urgent: bool = False) -> int:
        """Asks the unit over *bus* what it is, if the port was opened again or nobody has asked yet.

        A unit that refuses to tell is known by that. One that stays silent is not known, and is asked the next time; so
        is one that refuses for the moment only, as where a password locks it or a gateway does not reach it. Whether it
        contradicts its profile is looked at only where it is to be *judged*, or where it behaves as a unit of another
        family; where it does, it is asked each time.

        Returns:
            The connection for which that holds: what is sent on it goes to the unit that was asked.

        Raises:
            NotAllowed: What it says speaks against the profile, or another unit answers at this address now, or it was
                asked again and refused for the moment.
            NoAnswer, BadAnswer, PortError: It was asked again, and did not tell. What was to follow was not sent.
        """
        kind, told = await carried_out(self.seen_as(self._profile).check(judged, urgent), bus)
        if kind == "same":
            connection: int = told
            return connection
        raise self.not_same(kind, told)

    async def contradiction(self, bus: AwaitableBus) -> str | None:
        """What the unit says against its profile, and what to do; None if nothing. Asks it in any case."""
        against = await carried_out(self.seen_as(self._profile).contradiction(), bus)
        return None if against is None else in_words(self._profile, self._unit, against)

    def not_same(self, kind: str, told: Any) -> DrivebusError:
        """Why nothing may be written to the unit: of which *kind* that is, and what is *told* of it."""
        if kind != "unsaid":
            return WrongDrive(self._told(kind, told), unit=self._unit)
        # `started` stays None: of what was to follow, nothing left.
        error: DrivebusError = type(told)(
            f"{self._unsaid()} ({told}); nothing was written", unit=self._unit, raw=told.raw
        )
        error.__cause__ = told
        return error

    def _told(self, kind: str, told: Any) -> str:
        if kind == "contradicts":
            return Text(in_words(self._profile, self._unit, told), "; nothing was written to it")
        if kind == "put_off":
            return f"{self._unsaid()} ({told}); nothing was written"
        before, now = told
        return (
            f"another drive answers as unit {self._unit} since the port was opened again: its identification was "
            f"{before}, and is {now} now; nothing was sent. If that is right, ask for the drive anew: "
            f"bus.drive({self._unit})"
        )

    def _unsaid(self) -> str:
        return f"the port was opened again, and unit {self._unit} has not identified itself since"
