"""Whether what a unit says of itself speaks against the profile that it was named with.

A profile is named by people, and people mistake one drive for another. What speaks against one is only what documents
or other programs say of another family: a code that is listed for that, or a word that units of the named one always
have, refused as an address that there is none. An unknown code tells nothing, for firmwares differ; nor does a locked
drive, nor a silent one.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from drivebus.identify import codes
from drivebus.identify.identify import no_such_address, one_of
from drivebus.profile import Profile, profiles
from drivebus.protocols import ProfileProtocol

__all__ = ["Answer", "contradiction", "signature_of"]


class Answer(NamedTuple):
    """How a unit answered the question for the word at *address*: with a *word*, or with an *exception*."""

    address: int
    word: int | None
    exception: int | None


def contradiction(profile: ProfileProtocol, unit: int, answers: Iterable[Answer]) -> str | None:
    """What among *answers* speaks against *profile*, and what to do about it; None if nothing does."""
    known_by = profile.role("identification") or signature_of(profile) or _shipped(profile.reports_as())
    if not known_by:
        # A profile of somebody's own that says nothing of how its units are known: they may be anything.
        return None
    told = list(answers)
    # A code says most: what the unit is, and not only what it is not.
    found = [judge(profile, unit, answer) for judge in (_by_code, _by_refusal) for answer in told]
    against = next(filter(None, found), None)
    if against is None:
        return None
    return (
        f"unit {unit} was named {profile.name} ({profile.title}), and {against}; or say trust_profile=True "
        "(`--trust-profile`) if it is meant"
    )


def signature_of(profile: ProfileProtocol) -> dict[str, list[int]] | None:
    """How a unit of the family without a code is told; an overlay has that of the family below it."""
    below = profile.family if profile.family in profiles() else None
    return profile.signature() or (None if below is None else Profile.builtin(below).signature())


def _by_code(profile: ProfileProtocol, unit: int, answer: Answer) -> str | None:
    rows = _listed(profile, answer)
    families = list(dict.fromkeys(name for row in rows for name in (row["family"], *(row.get("shared") or ()))))
    if not families or set(families) & set(profile.reports_as()):
        return None
    titles = [f"{row['title']} ({row['family']})" for row in rows]
    also = [name for name in families if name not in [row["family"] for row in rows]]
    known = _shipped(families)
    if known:
        then = one_of(f'bus.drive({unit}, profile="{name}") (`--profile {name}`)' for name in known)
        then = f"ask for it as that: {then}"
    else:
        then = "there is no profile of it yet"
    if profile.name not in profiles():
        then += f". If {profile.name} is meant for such units, list that code under [[identification.codes]] in it"
    return f"it says {answer.word:04X}H, which is a {one_of([*titles, *also])}: {then}"


def _listed(profile: ProfileProtocol, answer: Answer) -> list[dict[str, Any]]:
    """What the profile itself and the shipped ones say of the word that came, if codes stand at its address."""
    if answer.word is None:
        return []
    rows = [row for row in profile.identifications() if row["code"] == answer.word]
    rows = rows if answer.address == _place(profile) else []
    return rows + (codes.listed().get(answer.word, []) if answer.address in codes.registers() else [])


def _by_refusal(profile: ProfileProtocol, unit: int, answer: Answer) -> str | None:
    if answer.exception is None or answer.address not in _must_have(profile):
        return None
    if not no_such_address(profile, answer.exception):
        return None
    return (
        f"it refuses {answer.address:04X}H (exception {answer.exception:02X}H: there is no such address), which each "
        f"of those answers: see what it is (bus.identify({unit}), `drivebus info`) and name that"
    )


def _must_have(profile: ProfileProtocol) -> tuple[int, ...]:
    """Addresses that every unit of the family answers."""
    signature = signature_of(profile)
    answered = () if signature is None else tuple(signature["answers"])
    place, register = _place(profile), profile.role("identification")
    if place is None or register is None:
        return answered
    # A row that was only taken over from a sister proves nothing, unless a code is listed that would stand there.
    rows = [*profile.identifications(), *(row for listed in codes.listed().values() for row in listed)]
    listed = any(row["family"] == profile.family for row in rows)
    return (*answered, place) if listed or profile.describe(register).evidence == "verified" else answered


def _place(profile: ProfileProtocol) -> int | None:
    """Where the family says what it is."""
    register = profile.role("identification")
    return None if register is None else profile.describe(register).address


def _shipped(families: Iterable[str]) -> list[str]:
    return [name for name in families if name in profiles()]
