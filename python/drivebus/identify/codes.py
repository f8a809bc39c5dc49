"""Identification codes: where units keep them, and what profiles list of each.

A code says what documents say of it, and no more: some families share one, and some codes are known from other people's
programs alone. Whoever wants to know of a code asks here; the tables themselves are of the shipped profiles.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable

from drivebus.profile import Profile, profiles
from drivebus.profile.facts import IdentificationCode

__all__ = ["address_of", "are_own", "families_in", "is_listed", "listed", "listed_at", "listed_for", "registers"]


def address_of(profile: Profile) -> int | None:
    """The address where units of *profile* keep their code; None if they have none."""
    register = profile.role("identification")
    return None if register is None else profile.describe(register).place


@functools.cache
def registers() -> tuple[int, ...]:
    """The addresses where units of the shipped families keep their codes."""
    addresses = map(address_of, map(Profile.builtin, profiles()))
    return tuple(dict.fromkeys(address for address in addresses if address is not None))


@functools.cache
def listed() -> dict[int, list[IdentificationCode]]:
    """The rows of each code in the shipped profiles; of profiles that say the same of a family, the first."""
    found: dict[int, dict[str, IdentificationCode]] = {}
    for name in profiles():
        for row in Profile.builtin(name).identifications():
            known = found.setdefault(row.code, {}).setdefault(row.family, row)
            if row.verified and not known.verified:
                found[row.code][row.family] = row
    return {code: list(rows.values()) for code, rows in found.items()}


def listed_at(address: int, word: int) -> list[IdentificationCode]:
    """The rows of the code *word*, if codes stand at *address*; elsewhere it is a word like any other."""
    return listed().get(word, []) if address in registers() else []


def listed_for(profile: Profile, address: int, word: int) -> list[IdentificationCode]:
    """The rows of the code *word* at *address* in *profile* itself, then those in the shipped ones."""
    own = profile.identifications() if address == address_of(profile) else []
    return [*(row for row in own if row.code == word), *listed_at(address, word)]


def are_own(profile: Profile, rows: Iterable[IdentificationCode]) -> bool:
    """Whether *rows* of one code name a family that units of *profile* report as."""
    return not set(families_in(rows)).isdisjoint(profile.reports_as())


@functools.lru_cache(maxsize=256)
def is_listed(profile: Profile) -> bool:
    """Whether *profile* or a shipped one lists a code of the family of *profile*."""
    rows = [*profile.identifications(), *(row for rows in listed().values() for row in rows)]
    return any(row.family == profile.family for row in rows)


def families_in(rows: Iterable[IdentificationCode]) -> list[str]:
    """The families that may be meant by *rows*, each once: those that list the code, and those that share it."""
    return list(dict.fromkeys(name for row in rows for name in (row.family, *row.shared)))
