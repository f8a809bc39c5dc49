"""The dead man of the page: who set a motor in motion answers for it as long as one of their pages says so.

An open connection says nothing: when a cable is cut, it stays open for minutes. So pages give a sign each second, as
long as they hear of the plant. Time is an argument.
"""

from __future__ import annotations

import threading

__all__ = ["Presence"]


class Presence:
    """Who is there. Any thread.

    Args:
        dead_man: Seconds without a sign after which somebody is gone.
    """

    def __init__(self, dead_man: float) -> None:
        self._dead_man = dead_man
        self._last: dict[str, float] = {}
        self._lock = threading.Lock()

    def here(self, person: str, now: float) -> None:
        """One of *person*'s pages gave a sign, or an order."""
        with self._lock:
            self._last[person] = now

    def gone(self, now: float) -> list[str]:
        """Those who are gone since this was asked last; each is told once."""
        with self._lock:
            gone = [person for person, last in self._last.items() if now - last > self._dead_man]
            for person in gone:
                del self._last[person]
            return gone
