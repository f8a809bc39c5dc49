"""The core's view of a family: what its units answer and refuse, and whom its words harm; worked out once of each."""

from __future__ import annotations

import functools

from drivebus import _native
from drivebus.profile.profile import Profile, native_of

__all__ = ["family_of"]


@functools.lru_cache(maxsize=256)
def family_of(profile: Profile) -> _native.Family:
    """The family of *profile*, shipped or somebody's own."""
    return _native.Family(native_of(profile))
