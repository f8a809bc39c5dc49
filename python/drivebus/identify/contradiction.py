"""Whether what a unit says of itself speaks against the profile that it was named with.

A profile is named by people, and people mistake one drive for another. What speaks against one is only what documents
or other programs say of another family: a code that is listed for that, or a word that units of the named one always
have, refused as an address that there is none. An unknown code tells nothing, for firmwares differ; nor does a locked
drive, nor a silent one.
"""

from __future__ import annotations

from collections.abc import Iterable

from drivebus import tables
from drivebus.advice import Advice, Text, argument
from drivebus.identify import codes
from drivebus.identify.families import asked_as, one_of, shipped
from drivebus.identify.refusals import NO_FUNCTION, Answer, no_such_address
from drivebus.identify.signatures import signature_of
from drivebus.profile import Profile, profiles

__all__ = ["contradiction", "is_suspicious", "other_signature"]


def contradiction(profile: Profile, unit: int, answers: Iterable[Answer]) -> str | None:
    """What among *answers* speaks against *profile*, and what to do about it; None if nothing does."""
    if not _is_known_by_something(profile):
        return None
    told = list(answers)
    # A code says most: what the unit is, and not only what it is not.
    found = [judge(profile, unit, answer) for judge in (_by_code, _by_refusal) for answer in told]
    against = next(filter(None, found), None)
    if against is None:
        return None
    return _told(profile, unit, against)


def is_suspicious(profile: Profile, answers: Iterable[Answer]) -> bool:
    """Whether a unit of *profile* would hardly give these *answers*, so that it is worth asking what else it may be.

    It is not what speaks against the profile: firmwares differ, and so do editions of manuals.
    """
    if not _is_known_by_something(profile):
        return False
    signature = signature_of(profile)
    refused = () if signature is None else tuple(signature["refuses"])
    return any(_surprises(profile, answer, refused) for answer in answers)


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


def _is_known_by_something(profile: Profile) -> bool:
    """Not so of a profile of somebody's own that says nothing of how its units are known: they may be anything."""
    return bool(profile.role("identification") or signature_of(profile) or shipped(profile.reports_as()))


def _surprises(profile: Profile, answer: Answer, refused: tuple[int, ...]) -> bool:
    """Whether *answer* is not what a unit of *profile* says there; at *refused* it has nothing."""
    if answer.word is None:
        lacks = answer.exception is not None and no_such_address(profile, answer.exception)
        if profile.name_at(answer.address) is None:
            # It has nothing there, as is right, and says so in the words of another family.
            return not lacks
        return answer.address not in refused
    if answer.address in refused:
        return True
    if answer.address in codes.registers():
        # A word that no list has for it: another maker keeps his speed there.
        rows = codes.listed_for(profile, answer.address, answer.word)
        return not codes.are_own(profile, rows)
    state = profile.role("state")
    is_state = state is not None and profile.describe(state).place == answer.address
    return is_state and profile.state(answer.word) == "unknown"


def _by_code(profile: Profile, unit: int, answer: Answer) -> str | None:
    """What speaks against *profile* if the word that came is the code of another family."""
    rows = [] if answer.word is None else codes.listed_for(profile, answer.address, answer.word)
    families = codes.families_in(rows)
    if not families or codes.are_own(profile, rows):
        return None
    titles = [f"{row.title} ({row.family})" for row in rows]
    also = [name for name in families if name not in [row.family for row in rows]]
    known = shipped(families)
    then = Text("ask for it as that: ", asked_as(unit, known)) if known else "there is no profile of it yet"
    if profile.name not in profiles():
        more = f". If {profile.name} is meant for such units, list that code under [[identification.codes]] in it"
        then = Text(then, more)
    return Text(f"it reports {answer.word:04X}H, the code of {one_of([*titles, *also])}: ", then)


def _by_refusal(profile: Profile, unit: int, answer: Answer) -> str | None:
    """What speaks against *profile* if the unit says that it lacks an address which each unit of it has."""
    if answer.exception is None or answer.address not in _must_have(profile):
        return None
    table, _ = tables.split(answer.address)
    no_function = table != "holding" and answer.exception == NO_FUNCTION
    if not no_function and not no_such_address(profile, answer.exception):
        return None
    what = "function" if no_function else "address"
    return Text(
        f"it refuses {tables.shown(answer.address)} (exception {answer.exception:02X}H: there is no such {what}), "
        "which each of those answers: see what it is (",
        Advice("identify", unit, f"bus.identify({unit})"),
        ") and name that",
    )


def _must_have(profile: Profile) -> tuple[int, ...]:
    """The addresses that every unit of *profile* answers."""
    signature = signature_of(profile)
    answered = () if signature is None else tuple(signature["answers"])
    place, register = codes.address_of(profile), profile.role("identification")
    if place is None or register is None:
        return answered
    # A row that was only taken over from a sister proves nothing, unless a code is listed that would stand there.
    sure = codes.is_listed(profile) or profile.describe(register).evidence == "verified"
    return (*answered, place) if sure else answered
