"""Whether what a unit says of itself speaks against the profile that it was named with.

A profile is named by people, and people mistake one drive for another. What speaks against one is only what documents
or other programs say of another family: a code that is listed for that, or a word that units of the named one always
have, refused as an address that there is none. An unknown code tells nothing, for firmwares differ; nor does a locked
drive, nor a silent one.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from drivebus import tables
from drivebus.advice import Advice, Text, argument
from drivebus.identify import codes
from drivebus.identify.families import asked_as, one_of, shipped
from drivebus.identify.refusals import Answer
from drivebus.profile import Profile, profiles
from drivebus.profile.facts import IdentificationCode
from drivebus.profile.family import family_of

__all__ = ["contradiction", "is_suspicious", "other_signature"]


def contradiction(profile: Profile, unit: int, answers: Sequence[Answer]) -> str | None:
    """What among *answers* speaks against *profile*, and what to do about it; None if nothing does."""
    against = family_of(profile).contradiction(answers)
    if against is None:
        return None
    kind, place, said, rows = against
    if kind == "code":
        return _told(profile, unit, _by_code(profile, unit, said, codes.rows_of(rows)))
    return _told(profile, unit, _by_refusal(unit, kind, place, said))


def is_suspicious(profile: Profile, answers: Sequence[Answer]) -> bool:
    """Whether a unit of *profile* would hardly give these *answers*, so that it is worth asking what else it may be.

    It is not what speaks against the profile: firmwares differ, and so do editions of manuals.
    """
    return family_of(profile).is_suspicious(answers)


def other_signature(profile: Profile, unit: int, shown: Iterable[str]) -> str | None:
    """What speaks against *profile* if a unit answers and refuses what those of the families *shown* do."""
    names = list(shown)
    if not names or set(names) & set(profile.reports_as()):
        return None
    titles = [f"{Profile.builtin(name).title} ({name})" for name in names]
    then = asked_as(unit, names)
    return _told(profile, unit, f"it answers and refuses what a {one_of(titles)} does: ask for it as that: ", then)


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
