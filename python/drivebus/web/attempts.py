"""How often somebody may try to log in: after some failures with a pause that grows, and never locked out for ever.

Pauses count for an address, and for a name. A name is not made to wait at an address where it was logged in before: a
stranger who tries names keeps nobody out. Time is an argument.
"""

from __future__ import annotations

import ipaddress
import threading
from dataclasses import dataclass
from typing import Any

__all__ = ["Attempts", "network_of"]

_FREE = 3
"""Failures without a pause."""
_LONGEST = {"address": 60.0, "name": 15.0}
"""Seconds of a pause at most."""
_FORGOTTEN = 900.0
"""Seconds after the last failure, when all are forgotten."""
_KEPT = 5_000
"""Addresses and names that are remembered; beyond that, those that failed longest ago are not."""


@dataclass
class _Failures:
    count: int = 0
    last: float = 0.0


class Attempts:
    """What was tried. Any thread."""

    def __init__(self) -> None:
        self._failures: dict[tuple[str, str], _Failures] = {}
        self._known: dict[tuple[str, str], None] = {}
        self._lock = threading.Lock()

    def wait(self, address: str, name: str, now: float) -> float:
        """Seconds until *name* may be tried from *address* again; 0: now."""
        with self._lock:
            return max(self._left(key, now) for key in self._keys(address, name))

    def failed(self, address: str, name: str, now: float) -> None:
        """The password was wrong."""
        with self._lock:
            for key in _keys(address, name):
                known = self._failures.pop(key, _Failures())
                count = known.count if now - known.last < _FORGOTTEN else 0
                self._failures[key] = _Failures(count + 1, now)
            _shorten(self._failures)

    def succeeded(self, address: str, name: str) -> None:
        """The password was right."""
        with self._lock:
            for key in _keys(address, name):
                self._failures.pop(key, None)
            self._known[network_of(address), name] = None
            _shorten(self._known)

    def _keys(self, address: str, name: str) -> list[tuple[str, str]]:
        keys = _keys(address, name)
        return keys[:1] if (network_of(address), name) in self._known else keys

    def _left(self, key: tuple[str, str], now: float) -> float:
        known = self._failures.get(key)
        if known is None or known.count < _FREE or now - known.last >= _FORGOTTEN:
            return 0.0
        pause = min(2.0 ** (known.count - _FREE), _LONGEST[key[0]])
        return max(known.last + pause - now, 0.0)


def network_of(address: str) -> str:
    """Whose *address* that is: of IPv6 the first half, which one who has one has all of."""
    try:
        known = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if known.version == 4:
        return str(known)
    return str(known.ipv4_mapped or ipaddress.ip_network((known, 64), strict=False))


def _keys(address: str, name: str) -> list[tuple[str, str]]:
    return [("address", network_of(address)), ("name", name)]


def _shorten(table: dict[tuple[str, str], Any]) -> None:
    while len(table) > _KEPT:
        del table[next(iter(table))]
