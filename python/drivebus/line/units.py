"""What is known of the units of a line: one record for each address, owned by the line and seen by every handle.

A record says what the unit was named as and said of itself, what was sent to it, and what it showed last. Whoever asks,
a drive, a guard or a stop, asks here: two handles of one unit have one memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

from drivebus._native import Identity, Record
from drivebus.line.addresses import Addresses
from drivebus.line.write_guard import check_words, prepare_guard
from drivebus.profile import Profile
from drivebus.values import State

__all__ = ["UnitRecord", "Units", "belongs", "units_of"]


@dataclass(slots=True, eq=False, repr=False)
class UnitRecord:
    """What is known of one unit.

    Attributes:
        address: Its address, 1..247.
        profiles: What it was asked for as, by name; the latest stands last.
        sent: What was sent to it, and what it said of itself.
        trusted: The names of profiles under which it was asked for as `unverified`.
        last_state: The state that was seen last, in words, and when on the line's clock.
        shown: The state that was seen last, and the fault in words where it was in one.
        is_lost: Whether the line failed when it was asked last.
        started_under: The profile by which it was started last.
    """

    address: int
    profiles: dict[str, Profile] = field(default_factory=dict)
    sent: Record = field(default_factory=Record)
    trusted: set[str] = field(default_factory=set)
    last_state: tuple[str, float] | None = None
    shown: tuple[State, str | None] | None = None
    is_lost: bool = False
    started_under: Profile | None = None

    @property
    def starts(self) -> int:
        """How many starts were sent, or were about to be."""
        return self.sent.starts

    @property
    def halts(self) -> int:
        """How many stops have gone out."""
        return self.sent.halts

    @property
    def started_unverified(self) -> bool:
        """Whether it was started by what is not verified, and so may be stopped by that."""
        return self.sent.started_unverified

    @property
    def profile(self) -> Profile | None:
        """The profile under which it is seen: that of its last start, where it was asked for as that, or the latest."""
        latest = next(reversed(self.profiles.values()), None)
        started = self.started_under
        return started if latest is not None and started is not None and started.name == latest.name else latest

    def identity(self, profile: Profile, connection: int) -> Identity:
        """What it said of itself in the words of *profile*; nothing yet, where nobody asked since *connection* began.

        Whoever asks for a drive anew takes whatever answers there now.
        """
        return self.sent.identity(profile.name, connection)


class Units:
    """The units of one line, by address.

    Attributes:
        addresses: Which may be asked.
    """

    def __init__(self, addresses: Addresses | None = None) -> None:
        self.addresses = Addresses() if addresses is None else addresses
        self._records: dict[int, UnitRecord] = {}

    def record(self, unit: int) -> UnitRecord:
        """The record of *unit*, begun where there is none yet."""
        return self._records.setdefault(unit, UnitRecord(unit))

    def add(self, unit: int, profile: Profile, *, unverified: bool = False) -> None:
        """From now on *unit* is known as what *profile* describes."""
        record = self.record(unit)
        record.profiles.pop(profile.name, None)  # what was asked for last stands last
        record.profiles[profile.name] = profile
        if unverified:
            record.trusted.add(profile.name)
        prepare_guard(profile)  # now, so that no stop has to wait for it

    def named(self) -> list[UnitRecord]:
        """The records of the units that a drive was asked for."""
        return [record for record in tuple(self._records.values()) if record.profiles]

    def only(self, unit: int) -> Profile | None:
        """The profile of *unit*, where it is known as one and no other."""
        record = self._records.get(unit)
        profiles = [] if record is None else list(record.profiles.values())
        return profiles[0] if len(profiles) == 1 else None

    def check(self, unit: int, address: int, words: int | Sequence[int], force: bool = False) -> None:
        """Raises `NotAllowed` if the words would command *unit* (0: any of them) what its family does not define."""
        if force or not self._records:
            return
        one = self._records.get(unit)
        for record in ([] if one is None else [one]) if unit else self.named():
            if record.profiles:
                check_words(record.profiles.values(), record.address, address, words)

    def check_pdu(self, unit: int, pdu: bytes, force: bool = False) -> None:
        """As `check`, for what a request to write carries; any other is let pass."""
        from drivebus.rtu import may_write

        for address, words in may_write(pdu):
            self.check(unit, address, words, force)


_BY_LINE: WeakKeyDictionary[object, Units] = WeakKeyDictionary()


def belongs(units: Units, line: object) -> None:
    """Says that *units* are those of *line*."""
    _BY_LINE[line] = units


def units_of(line: object) -> Units:
    """The units of *line*, begun where there are none yet."""
    # A bus of somebody's own may be nothing that a weak reference takes: then each handle has a memory of its own.
    with suppress(TypeError):
        return _BY_LINE.setdefault(line, Units())
    return Units()
