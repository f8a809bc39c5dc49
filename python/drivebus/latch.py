"""Waiting in the main thread, where Ctrl-C may come at any moment."""

from __future__ import annotations

import math
import threading
import time
from contextlib import suppress

__all__ = ["Latch"]

_LOOKS = 0.5
"""Seconds after which a wait looks for a signal that came just before it began to wait, and woke nobody."""


class Latch:
    """Closed once, and waited for until then; a `KeyboardInterrupt` out of `wait` is nothing but that.

    A `threading.Event` gives its lock back twice where a signal comes just when it begins to wait: what is raised then
    is "RuntimeError: release unlocked lock", and no `except KeyboardInterrupt` takes it.
    """

    def __init__(self) -> None:
        self._is_set = False
        self._waiting: list[threading.Lock] = []

    def is_set(self) -> bool:
        """Whether it was closed."""
        return self._is_set

    def set(self) -> None:
        """Closes it: everybody goes on."""
        self._is_set = True
        with suppress(IndexError):
            while True:
                self._waiting.pop().release()

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until it is closed, for *timeout* seconds at most; returns whether it was."""
        # A lock for each wait: nothing of it has to be put right when it is broken off.
        lock = threading.Lock()
        lock.acquire()
        self._waiting.append(lock)
        until = math.inf if timeout is None else time.monotonic() + timeout
        # Who closes it from here on finds the lock.
        while not self._is_set and not lock.acquire(timeout=min(_LOOKS, max(until - time.monotonic(), 0.0))):
            if time.monotonic() >= until:
                break
        with suppress(ValueError):
            self._waiting.remove(lock)
        return self._is_set
