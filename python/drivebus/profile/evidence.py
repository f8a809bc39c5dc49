"""What may be asked of a drive where its documents are silent.

The rule stands in the core (`crates/drive`): what documents of the very family print may be used, and what they print
in part or not at all is for who says `unverified=True`. Here are its words.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from drivebus import _native, checks
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument, NotAllowed, Unverified
from drivebus.profile.profile import Profile, native_of

__all__ = ["Evidence", "not_verified", "refusal_of"]

_T = TypeVar("_T")

_WHY_UNKNOWN = "no document of this family says so"
_UNVERIFIED = argument("unverified", True)
_NO_RANGE = "its range is not printed"


def not_verified(what: str, reason: str | None, unit: int) -> NotAllowed:
    """The error for *what* of *unit*, which is not verified for the *reason* that the profile gives."""
    return Unverified(
        Text(
            f"{what} is not verified: ",
            _sentence(reason),
            f" Nothing was sent to unit {unit}; use ",
            _UNVERIFIED,
            " to do it anyway",
        ),
        unit=unit,
    )


def refusal_of(check: Callable[..., object], *args: object, **kwargs: object) -> NotAllowed:
    """The error by which *check* refuses what it is given, where the core has said that it does."""
    try:
        check(*args, **kwargs)
    except NotAllowed as error:
        return error
    raise RuntimeError(f"{check.__qualname__} refuses neither {args} nor {kwargs}")


class Evidence:
    """The rule for one unit: one profile, under one trust. What it works out once is kept here.

    Args:
        profile: What is known of its family.
        unit: Its address, for messages.
        unverified: Whether what is not verified may be used.
    """

    def __init__(self, profile: Profile, unit: int, unverified: bool) -> None:
        self.profile = profile
        self.unverified = unverified
        self.unit = unit
        self._rule = _native.Rule(native_of(profile), unverified)
        self._readable: set[str] = set()
        self._worked_out: dict[Callable[[Evidence], Any], Any] = {}

    def trusting(self, unverified: bool) -> Evidence:
        """The rule under which, if *unverified*, what is not verified may be used as well."""
        return self.cached(_all_of_it) if unverified and not self.unverified else self

    def of(self, profile: Profile) -> Evidence:
        """The same trust in another profile."""
        return Evidence(profile, self.unit, self.unverified)

    def cached(self, work: Callable[[Evidence], _T]) -> _T:
        """What *work* makes of this, worked out when it is asked for first."""
        try:
            result: _T = self._worked_out[work]
        except KeyError:
            # Kept only when it is whole: another thread may ask meanwhile.
            result = self._worked_out[work] = work(self)
        return result

    def require_readable(self, names: Iterable[str]) -> None:
        """Raises `NotAllowed` if one of *names* may not be read."""
        for name in names:
            if not isinstance(name, str):
                raise BadArgument(
                    f"a name is a text, and {checks.shown(name)} is not; nothing was sent to unit {self.unit}",
                    unit=self.unit,
                )
            # Programs read the same few names again and again.
            if name in self._readable:
                continue
            why = self._rule.read(name)
            if why is not None:
                kind, reason = why
                if kind == "no_address":
                    raise self._without_address(name)
                if kind == "only_written":
                    raise BadArgument(f"{self._named(name)} can only be written; nothing was sent", unit=self.unit)
                raise not_verified(f"reading {self._named(name)}", reason, self.unit)
            self._readable.add(name)

    def unreadable(self, name: str) -> str | None:
        """Why *name* may not be read; None if it may."""
        return self._worded(self._rule.read(name))

    def readable(self, names: Iterable[str]) -> list[str]:
        """Those of *names* that may be read."""
        return [name for name in names if self.unreadable(name) is None]

    def require_writable(self, name: str) -> None:
        """Raises `NotAllowed` if *name* may not be written."""
        why = self._rule.write(name)
        if why is not None:
            kind, reason = why
            if kind == "no_address":
                raise self._without_address(name)
            raise not_verified(f"writing {self._named(name)}", reason, self.unit)

    def require_writable_word(self, name: str, word: int) -> None:
        """Raises `NotAllowed` if nothing that is printed tells whether *name* takes *word*."""
        if self._rule.word(name, word) is not None:
            raise not_verified(f"writing {word} to {self._named(name)}", _NO_RANGE, self.unit)

    def require_bits(self, name: str, field: str) -> None:
        """Raises `NotAllowed` if where *field* is in the word *name* is not printed."""
        reason = self._worded(self._rule.bits(name, field))
        if reason is not None:
            raise not_verified(f"where {field} is in {name} of {self.profile.title}", reason, self.unit)

    def require_kept(self, name: str, *, store: bool) -> None:
        """Raises `NotAllowed` if how *name* is written for good, or else to RAM alone, is not printed."""
        reason = self.unkept(name, store=store)
        if reason is not None:
            kept = "EEPROM" if store else "RAM"
            raise not_verified(f"how {self.profile.title} keeps a parameter in {kept}", reason, self.unit)

    def unkept(self, name: str, *, store: bool) -> str | None:
        """Why *name* may not be written for good, or else to RAM alone; None if it may, where its address is known."""
        return self._worded(self._rule.kept(name, store))

    def undecided(self, variant: str) -> str | None:
        """Why what the parameter of *variant* says may not be used; None if it may."""
        return self._worded(self._rule.variant(variant))

    def require_command(self, name: str) -> None:
        """Raises `NotAllowed` if the family has no command *name*, or it may not be given."""
        why = self._rule.command(name)
        if why is not None:
            kind, reason = why
            if kind == "no_command":
                raise BadArgument(f"{self.unusable(name)}; nothing was sent to unit {self.unit}", unit=self.unit)
            raise not_verified(f"the command {name} of {self.profile.title}", reason, self.unit)

    def unusable(self, command: str) -> str | None:
        """Why *command* may not be given; None if it may."""
        return self._worded(self._rule.command(command), f"command {command}")

    def without_state(self) -> str | None:
        """Why the family's states may not be used; None if they may."""
        return self._worded(self._rule.state())

    def without_fault(self) -> str | None:
        """Why the present fault may not be read; None if it may."""
        return self._worded(self._rule.fault())

    def missing(self, what: str, reason: str, better: Callable[[Evidence], str | None]) -> NotAllowed:
        """The error for *what*, which cannot be done for *reason*; *better* tells it under unverified=True."""
        helps = better(self.trusting(True)) is None
        hint = Text("; ", _UNVERIFIED, " uses what is assumed") if helps else ""
        told = Text(f"{what}: ", _sentence(reason), f" Nothing was sent to unit {self.unit}", hint)
        return Unverified(told, unit=self.unit)

    def _worded(self, why: tuple[str, str] | None, what: str = "") -> str | None:
        """A reason of the core in words; None where there is none."""
        if why is None:
            return None
        kind, reason = why
        if kind == "no_address":
            return f"its address is not known: {_sentence(reason)}"
        if kind == "only_written":
            return "it can only be written"
        missing = {"no_command": what, "no_state": "state word", "no_fault": "fault register"}.get(kind)
        return (reason or _WHY_UNKNOWN) if missing is None else f"no {missing} of {self.profile.title} is known"

    def _named(self, name: str) -> str:
        return f"{name} ({self.profile.describe(name).label}) of {self.profile.title}"

    def _without_address(self, name: str) -> NotAllowed:
        known = self.profile.describe(name)
        return Unverified(
            f"the address of {self._named(name)} is not known: {_sentence(known.reason or known.note)} Nothing was "
            f"sent to unit {self.unit}; an overlay on the profile can fill it in",
            unit=self.unit,
        )


def _all_of_it(evidence: Evidence) -> Evidence:
    """The rule of *evidence* with trust in what is not verified."""
    return Evidence(evidence.profile, evidence.unit, True)


def _sentence(reason: str | None) -> Text:
    return Text(Text(reason or _WHY_UNKNOWN).rstrip(" \n."), ".")
