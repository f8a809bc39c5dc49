"""Signatures: how units of a family without a code are told, by which words they answer and which they refuse."""

from __future__ import annotations

import functools
from collections.abc import Mapping

from drivebus.profile import Profile, profiles

__all__ = ["Signature", "is_shown", "listed", "signature_of"]

Signature = dict[str, list[int]]
"""The addresses that a unit `answers`, and those that it `refuses`: see `Profile.signature`."""


@functools.cache
def listed() -> dict[str, Signature]:
    """The signature of each shipped family that has one."""
    found = {name: Profile.builtin(name).signature() for name in profiles()}
    return {name: signature for name, signature in found.items() if signature is not None}


def signature_of(profile: Profile) -> Signature | None:
    """The signature of *profile*; an overlay has that of the family below it."""
    return profile.signature() or listed().get(profile.family)


def is_shown(signature: Signature, answered: Mapping[int, bool]) -> bool:
    """Whether a unit shows *signature*, by which addresses it *answered* (True) and which it refused (False)."""
    return all(answered.get(address) is True for address in signature["answers"]) and all(
        answered.get(address) is False for address in signature["refuses"]
    )
