"""Who is logged in: a table at the server, so that who logs out is out. Time is an argument."""

from __future__ import annotations

import hashlib
import secrets
import threading
from dataclasses import dataclass, field

__all__ = ["IDLE", "MOST", "Session", "Sessions"]

IDLE = 12 * 3600.0
"""Seconds without a request after which one is logged out."""
MOST = 100
"""Sessions at a time. One more ends the one that was idle longest."""


@dataclass
class Session:
    """Somebody who is logged in.

    Attributes:
        person: Who it is.
        form_token: What each of the session's forms has to bring: other sites do not know it.
        used: When it was used last, in seconds.
        streams: Its open streams of pictures, the oldest first.
    """

    person: str
    used: float
    form_token: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)
    streams: list[object] = field(default_factory=list, repr=False)


class Sessions:
    """The table. Tokens have 256 random bits, and are kept as their checksums: who reads memory finds none."""

    def __init__(self) -> None:
        self._of: dict[bytes, Session] = {}
        self._lock = threading.Lock()

    def begin(self, person: str, now: float) -> str:
        """Logs *person* in; the token that proves it."""
        token = secrets.token_urlsafe(32)
        with self._lock:
            self._forget(now)
            if len(self._of) >= MOST:
                del self._of[min(self._of, key=lambda each: self._of[each].used)]
            self._of[_key(token)] = Session(person, now)
        return token

    def of(self, token: str, now: float, uses: bool = True) -> Session | None:
        """Whose *token* that is; None: nobody's, or nobody's any more. It is in use again if it *uses* that."""
        with self._lock:
            self._forget(now)
            session = self._of.get(_key(token))
            if session is not None and uses:
                session.used = now
            return session

    def end(self, token: str) -> None:
        """Logs out who has *token*."""
        with self._lock:
            self._of.pop(_key(token), None)

    def _forget(self, now: float) -> None:
        for key in [key for key, each in self._of.items() if now - each.used > IDLE]:
            del self._of[key]


def _key(token: str) -> bytes:
    return hashlib.sha256(token.encode(errors="replace")).digest()
