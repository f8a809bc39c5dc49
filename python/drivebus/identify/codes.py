"""Identification codes: where units keep them, and what the shipped profiles say of each.

A code says what documents say of it, and no more: some families share one, and some codes are known from other people's
programs alone.
"""

from __future__ import annotations

import functools
from typing import Any

from drivebus.profile import Profile, profiles

__all__ = ["listed", "registers"]


@functools.cache
def registers() -> tuple[int, ...]:
    """The addresses where the shipped families keep their codes."""
    addresses: dict[int, None] = {}
    for profile in map(Profile.builtin, profiles()):
        name = profile.role("identification")
        address = None if name is None else profile.describe(name).address
        if address is not None:
            addresses[address] = None
    return tuple(addresses)


@functools.cache
def listed() -> dict[int, list[dict[str, Any]]]:
    """The rows of each code in the shipped profiles; of profiles that say the same of a family, the first."""
    found: dict[int, dict[str, dict[str, Any]]] = {}
    for name in profiles():
        for row in Profile.builtin(name).identifications():
            known = found.setdefault(row["code"], {}).setdefault(row["family"], row)
            if row["verified"] and not known["verified"]:
                found[row["code"]][row["family"]] = row
    return {code: list(rows.values()) for code, rows in found.items()}
