"""Passwords: kept as a hash that is slow to guess from, and compared in the same time whatever is given."""

from __future__ import annotations

import base64
import binascii
import re
import secrets
from typing import NamedTuple

__all__ = ["LEAST", "hashed", "is_hash", "is_right"]

LEAST = 10
"""Characters that a password has at least."""
_LONGEST = 200
"""Characters of one that is looked at."""
_N, _R, _P, _SALT, _LENGTH = 2**15, 8, 1, 16, 32
"""Of scrypt: 32 MB and a tenth of a second for each that is tried."""
_ALLOWED_N = range(2**14, 2**17 + 1)
_FORM = re.compile(r"scrypt\$(\d{1,7})\$(\d{1,2})\$(\d{1,2})\$([A-Za-z0-9+/=]{22,60})\$([A-Za-z0-9+/=]{40,100})")


class _Hash(NamedTuple):
    n: int
    r: int
    p: int
    salt: bytes
    key: bytes


def hashed(password: str) -> str:
    """What stands in the file for *password*: `scrypt$N$r$p$salt$hash`, with a salt of its own each time."""
    salt = secrets.token_bytes(_SALT)
    key = _derived(password, _Hash(_N, _R, _P, salt, bytes(_LENGTH)))
    told = [str(_N), str(_R), str(_P), *(base64.b64encode(part).decode() for part in (salt, key))]
    return "$".join(["scrypt", *told])


def is_hash(text: str) -> bool:
    """Whether *text* is what `hashed` gives, and no weaker."""
    return _read(text) is not None


def is_right(password: str, text: str | None) -> bool:
    """Whether *password* is the one that *text* was made of; None is nobody's, and takes as long."""
    known = None if text is None else _read(text)
    wanted = known or _Hash(_N, _R, _P, bytes(_SALT), bytes(_LENGTH))
    is_same = secrets.compare_digest(_derived(password[:_LONGEST], wanted), wanted.key)
    return is_same and known is not None and len(password) <= _LONGEST


def _derived(password: str, like: _Hash) -> bytes:
    # Not for who has no page: a stop waits for all that is loaded.
    import hashlib

    memory = 256 * like.n * like.r
    return hashlib.scrypt(
        password.encode(), salt=like.salt, n=like.n, r=like.r, p=like.p, maxmem=memory, dklen=len(like.key)
    )


def _read(text: str) -> _Hash | None:
    found = _FORM.fullmatch(text)
    if found is None:
        return None
    n, r, p = (int(part) for part in found.groups()[:3])
    try:
        salt, key = (base64.b64decode(part, validate=True) for part in found.groups()[3:])
    except (binascii.Error, ValueError):
        return None
    is_power = n & (n - 1) == 0
    is_strong = n in _ALLOWED_N and is_power and r == _R and 1 <= p <= 4 and len(salt) >= _SALT and len(key) == _LENGTH
    return _Hash(n, r, p, salt, key) if is_strong else None
