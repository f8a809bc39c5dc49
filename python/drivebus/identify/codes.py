"""Identification codes: where units keep them, and what profiles list of each.

A code says what documents say of it, and no more: some families share one, and some codes are known from other people's
programs alone. Whoever wants to know of a code asks here; the tables themselves are of the shipped profiles.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from drivebus import _native
from drivebus.profile import Profile

if TYPE_CHECKING:
    from drivebus.profile.facts import IdentificationCode

__all__ = ["address_of", "all_listed", "families_in", "listed_at", "registers", "rows_of"]


def address_of(profile: Profile) -> int | None:
    """The address where units of *profile* keep their code; None if they have none."""
    register = profile.role("identification")
    return None if register is None else profile.describe(register).place


def registers() -> tuple[int, ...]:
    """The addresses where units of the shipped families keep their codes."""
    return tuple(_native.code_places())


def all_listed() -> list[int]:
    """Every code that a shipped profile lists."""
    return _native.listed_codes()


def listed_at(address: int, word: int) -> list[IdentificationCode]:
    """The rows of the code *word*, if codes stand at *address*; elsewhere it is a word like any other.

    Of profiles that say the same of a family, the first.
    """
    return rows_of(_native.code_rows(address, word))


def rows_of(native: Iterable[dict[str, Any]]) -> list[IdentificationCode]:
    """Rows as the core has them."""
    from drivebus.profile.facts import IdentificationCode

    return [IdentificationCode(**{**row, "shared": tuple(row["shared"])}) for row in native]


def families_in(rows: Iterable[IdentificationCode]) -> list[str]:
    """The families that may be meant by *rows*, each once: those that list the code, and those that share it."""
    return list(dict.fromkeys(name for row in rows for name in (row.family, *row.shared)))
