"""Why a value was not read, sorted by what that says: nothing to read, or something that is still to be found out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from drivebus.errors import DrivebusError, Refused
from drivebus.profile import Profile
from drivebus.profile.refusals import means

__all__ = ["WHY", "Unread", "counts", "in_words", "is_open", "lost", "refused"]

WHY = ("not asked", "not there", "closed", "refused", "lost")
"""The reasons: it was left out on purpose; the drive has no such thing; it has it and does not tell it (a password, a
lock, a closed group); it refused for another reason; no answer came, or a damaged one, or the drive said that it was
busy or that the request came damaged."""

_OPEN = ("refused", "lost")
"""Those that say nothing of the drive: another time it may tell."""

_SAYS = {"no_such": "not there", "not_now": "closed", "ask_again": "lost", "taken": "lost"}
"""The reason of a refused read, by what the refusal means."""


class Unread(str):
    """Why a value was not read: a text, in every respect, and the kind of reason.

    Attributes:
        why: One of `"not asked"`, `"not there"`, `"closed"`, `"refused"`, `"lost"`.
    """

    why: str

    def __new__(cls, reason: str, why: str) -> Unread:
        """*reason*, of the kind *why*."""
        self = super().__new__(cls, reason)
        self.why = why
        return self

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return str(self), self.why

    @property
    def open(self) -> bool:
        """Whether it says nothing of the drive: `"refused"` for another reason, or `"lost"`."""
        return self.why in _OPEN


def refused(profile: Profile, error: Refused) -> Unread:
    """Why a drive of *profile* did not tell what it refused with *error*."""
    said = f"exception {error.code:02X}H, {error.name}: {error.meaning}" if error.meaning else str(error)
    return Unread(f"the drive refused to tell it: {said}", _SAYS.get(means(profile, error.code), "refused"))


def lost(error: DrivebusError) -> Unread:
    """Why there is no value where the line failed with *error*."""
    return Unread(str(error), "lost")


def is_open(reason: object) -> bool:
    """Whether *reason* says nothing of the drive."""
    return isinstance(reason, Unread) and reason.open


def counts(reasons: Iterable[object]) -> dict[str, int]:
    """How many there are of each kind, of those that have one."""
    found = Counter(reason.why for reason in reasons if isinstance(reason, Unread))
    return {why: found[why] for why in WHY if found[why]}


def in_words(reasons: Iterable[object]) -> str:
    """The same for people: `2 not asked, 1 lost`."""
    return ", ".join(f"{count} {why}" for why, count in counts(reasons).items())
