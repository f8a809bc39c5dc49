"""What a parameter without a row might be: what another family has under the same code, with the same factory value."""

from __future__ import annotations

from drivebus.errors import NotAllowed
from drivebus.profile import Profile, profiles

__all__ = ["guess"]


def guess(profile: Profile, code: str, word: int) -> str:
    """A sentence about *code*, whose *word* a drive of *profile* told; empty where there is nothing to say.

    A value that is 0 says nothing: most parameters of most drives are.
    """
    if word == 0:
        return ""
    for name in profiles():
        other = Profile.builtin(name)
        if other.family == profile.family:
            continue
        try:
            row = other.describe(code)
            if row.code != code or row.default is None or other.encode(code, row.default) != word:
                continue
        except NotAllowed:
            continue
        return f"A guess: {row.label}; {other.title} has that here, and this as its factory value."
    return ""
