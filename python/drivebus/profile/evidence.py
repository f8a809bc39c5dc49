"""What may be asked of a drive where its documents are silent.

What documents of the very family print may be used. What they print in part, or for a sister series, may be read;
written it is only for who says `unverified=True`, and so is whatever they do not print at all. What has no address
cannot be asked for in any case. Profiles know which is which, and why; here the rule stands, and its words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from drivebus.errors import NotAllowed
from drivebus.profile.profile import Profile

__all__ = ["Evidence", "not_verified"]

_WHY_UNKNOWN = "no document of this family says so"


def not_verified(what: str, reason: str | None, unit: int) -> NotAllowed:
    """The error for *what* of *unit*, which is not verified for the *reason* that the profile gives."""
    return NotAllowed(
        f"{what} is not verified: {_sentence(reason)} Nothing was sent to unit {unit}; with unverified=True "
        "(`--unverified`) it is done all the same",
        unit=unit,
    )


class Evidence:
    """The rule, for one unit.

    Args:
        profile: What is known of its family.
        unit: Its address, for messages.
        unverified: Whether what is not verified may be used.
    """

    def __init__(self, profile: Profile, unit: int, unverified: bool) -> None:
        self._profile = profile
        self._unit = unit
        self._unverified = unverified
        self._readable: set[str] = set()

    def reads(self, names: Iterable[str]) -> None:
        """Raises `NotAllowed` if one of *names* may not be read."""
        for name in names:
            if not isinstance(name, str):
                raise NotAllowed(f"name {name!r} is no text; nothing was sent to unit {self._unit}", unit=self._unit)
            # Programs read the same few names again and again.
            if name in self._readable:
                continue
            missing = self.unreadable(name)
            if missing is not None:
                known = self._profile.describe(name)
                if known.address is None:
                    raise self._without_address(name)
                if known.access == "wo":
                    raise NotAllowed(f"{self._named(name)} can only be written; nothing was sent", unit=self._unit)
                raise not_verified(f"reading {self._named(name)}", missing, self._unit)
            self._readable.add(name)

    def unreadable(self, name: str) -> str | None:
        """Why *name* may not be read; None if it may."""
        known = self._profile.describe(name)
        if known.address is None:
            return f"its address is not known: {_sentence(known.reason or known.note)}"
        if known.access == "wo":
            return "it can only be written"
        if known.evidence == "assumed" and not self._unverified:
            return known.reason or _WHY_UNKNOWN
        return None

    def readable(self, names: Iterable[str]) -> list[str]:
        """Those of *names* that may be read."""
        return [name for name in names if self.unreadable(name) is None]

    def writes(self, name: str) -> None:
        """Raises `NotAllowed` if *name* may not be written."""
        known = self._profile.describe(name)
        if known.address is None:
            raise self._without_address(name)
        if known.evidence != "verified" and not self._unverified:
            raise not_verified(f"writing {self._named(name)}", known.reason, self._unit)

    def commands(self, name: str) -> None:
        """Raises `NotAllowed` if the family has no command *name*, or it may not be given."""
        reason = self.unusable(name)
        if name not in self._profile.commands():
            raise NotAllowed(f"{reason}; nothing was sent to unit {self._unit}", unit=self._unit)
        if reason is not None:
            raise not_verified(f"the command {name} of {self._profile.title}", reason, self._unit)

    def unusable(self, command: str) -> str | None:
        """Why *command* may not be given; None if it may."""
        if command not in self._profile.commands():
            return f"no command {command} of {self._profile.title} is known"
        return None if self._unverified else self._profile.command_reason(command)

    def without_state(self) -> str | None:
        """Why the family's states may not be used; None if they may."""
        word = self._profile.role("state")
        if word is None:
            return f"no state word of {self._profile.title} is known"
        return self.unreadable(word) or (None if self._unverified else self._profile.state_reason())

    def without_fault(self) -> str | None:
        """Why the present fault may not be read; None if it may."""
        register = self._profile.role("fault")
        return f"no fault register of {self._profile.title} is known" if register is None else self.unreadable(register)

    def missing(self, what: str, reason: str, better: Callable[[Evidence], str | None]) -> NotAllowed:
        """The error for *what*, which cannot be done for *reason*; *better* tells it under unverified=True."""
        helps = better(Evidence(self._profile, self._unit, True)) is None
        hint = "; with unverified=True (`--unverified`) what is assumed of it is used" if helps else ""
        return NotAllowed(f"{what}: {_sentence(reason)} Nothing was sent to unit {self._unit}{hint}", unit=self._unit)

    def rule(self, what: str, reason: str | None) -> None:
        """Raises `NotAllowed` if *what* has a *reason* not to be used, and nobody said that it may be all the same."""
        if reason is not None and not self._unverified:
            raise not_verified(what, reason, self._unit)

    def _named(self, name: str) -> str:
        return f"{name} ({self._profile.describe(name).label}) of {self._profile.title}"

    def _without_address(self, name: str) -> NotAllowed:
        known = self._profile.describe(name)
        return NotAllowed(
            f"the address of {self._named(name)} is not known: {_sentence(known.reason or known.note)} Nothing was "
            f"sent to unit {self._unit}; an overlay on the profile can fill it in (docs/profiles.md)",
            unit=self._unit,
        )


def _sentence(reason: str | None) -> str:
    text = (reason or _WHY_UNKNOWN).strip().rstrip(".")
    return f"{text}."
