"""Whether an order is given now, and once: a page that lost the plant moves nothing, nor what is sent again."""

from __future__ import annotations

import re
import threading
from collections import OrderedDict

__all__ = ["FRESH", "Tickets"]

FRESH = 5.0
"""Seconds by which the picture that a page showed may be old when an order comes that was given at it."""
_KEPT = 10_000
_NUMBER = re.compile(r"[A-Za-z0-9_-]{16,64}")


class Tickets:
    """The numbers of orders that were given, which the pages draw."""

    def __init__(self) -> None:
        self._given: OrderedDict[str, None] = OrderedDict()
        self._lock = threading.Lock()

    def why_not(self, number: str, seen: str, now: float) -> str:
        """Why the order *number*, given at the picture of moment *seen*, is not carried out; empty: it may be, once.

        Both come as text from the page; *now* is the clock of the pictures, in seconds.
        """
        try:
            age = now - float(seen)
        except ValueError:
            return "the page did not say what it showed"
        if not -FRESH <= age <= FRESH:
            return "what the page showed was too old"
        if not _NUMBER.fullmatch(number):
            return "the page gave the order no number"
        with self._lock:
            if number in self._given:
                return "it was given already"
            self._given[number] = None
            while len(self._given) > _KEPT:
                self._given.popitem(last=False)
        return ""
