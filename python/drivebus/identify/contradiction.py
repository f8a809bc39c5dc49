"""Whether what a unit says of itself speaks against the profile that it was named with, in words.

A profile is named by people, and people mistake one drive for another. What speaks against one is decided in the core
(`crates/drive`): only what documents or other programs say of another family.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from drivebus import tables
from drivebus.advice import Advice, Text, argument
from drivebus.identify import codes
from drivebus.identify.families import asked_as, one_of, shipped
from drivebus.identify.refusals import Answer
from drivebus.profile import Profile, profiles
from drivebus.profile.family import family_of

if TYPE_CHECKING:
    from drivebus.profile.facts import IdentificationCode

__all__ = ["contradiction", "in_words"]


def contradiction(profile: Profile, unit: int, answers: Sequence[Answer]) -> str | None:
    """What among *answers* speaks against *profile*, and what to do about it; None if nothing does."""
    against = family_of(profile).contradiction(answers)
    return None if against is None else in_words(profile, unit, against)


def in_words(profile: Profile, unit: int, against: tuple[str, Any]) -> Text:
    """What speaks *against* a *unit* of *profile*, as the core has it, and what to do about it."""
    kind, told = against
    if kind == "code":
        _, code, rows = told
        return _told(profile, unit, _by_code(profile, unit, code, codes.rows_of(rows)))
    if kind == "signature":
        titles = [f"{Profile.builtin(name).title} ({name})" for name in told]
        then = asked_as(unit, told)
        return _told(profile, unit, f"it answers and refuses what a {one_of(titles)} does: ask for it as that: ", then)
    place, exception = told
    return _told(profile, unit, _by_refusal(unit, kind, place, exception))


def _told(profile: Profile, unit: int, *against: str) -> Text:
    return Text(
        f"unit {unit} was named {profile.name} ({profile.title}), and ",
        *against,
        "; or say ",
        argument("trust_profile", True),
        " if it is meant",
    )


def _by_code(profile: Profile, unit: int, code: int, rows: list[IdentificationCode]) -> Text:
    """What speaks against *profile* if the word that came is the *code* of another family."""
    families = codes.families_in(rows)
    titles = [f"{row.title} ({row.family})" for row in rows]
    also = [name for name in families if name not in [row.family for row in rows]]
    known = shipped(families)
    then = Text("ask for it as that: ", asked_as(unit, known)) if known else "there is no profile of it yet"
    if profile.name not in profiles():
        more = f". If {profile.name} is meant for such units, list that code under [[identification.codes]] in it"
        then = Text(then, more)
    return Text(f"it reports {code:04X}H, the code of {one_of([*titles, *also])}: ", then)


def _by_refusal(unit: int, kind: str, place: int, exception: int) -> Text:
    """What speaks against a profile if the unit says that it lacks an address which each unit of it has."""
    what = "function" if kind == "no_function" else "address"
    return Text(
        f"it refuses {tables.shown(place)} (exception {exception:02X}H: there is no such {what}), which each of those "
        "answers: see what it is (",
        Advice("identify", unit, f"bus.identify({unit})"),
        ") and name that",
    )
