"""What a word that is meant for one family does to a unit of another one: derived from all profiles, listed nowhere.

At one address a word stops one family, starts another and is a parameter of a third. What stops a motor may be sent to
a unit of which nothing is known only where it does none of that to any family. It is decided in the core
(`crates/drive`).
"""

from __future__ import annotations

import functools

from drivebus._native import HALTS
from drivebus.profile import Profile
from drivebus.profile.family import family_of

__all__ = ["HALTS", "harmed"]


@functools.lru_cache(maxsize=4096)
def harmed(named: Profile, what: str | int) -> tuple[Profile, ...]:
    """The families that *what* is written to a unit of *named* would do harm to; none where it has no such command."""
    return tuple(map(Profile.builtin, family_of(named).harmed(what)))
