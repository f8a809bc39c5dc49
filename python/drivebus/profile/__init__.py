"""What a family of drives means by its words, and how sure that is.

`profile` holds a family, `plan` the fewest reads for some names, `evidence` the rule for what no document proves.
"""

from drivebus.profile.profile import Profile, native_of, profiles

__all__ = ["Profile", "native_of", "profiles"]
