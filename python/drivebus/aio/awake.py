"""An event loop that wakes now and then while it runs a motor, so that it hears what is to end the program.

A signal does not wake every loop: not one that was about to wait when it came, and not where the system gave it to
another thread. Python's handler runs in the main thread when that is next awake, which may be in an hour.
"""

from __future__ import annotations

import asyncio

__all__ = ["Awake"]

_EVERY = 0.2
"""Seconds."""


class Awake:
    """Wakes the running loop from now on, until `end`."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._next = self._loop.call_later(_EVERY, self._again)

    def _again(self) -> None:
        self._next = self._loop.call_later(_EVERY, self._again)

    def end(self) -> None:
        """Wakes it no more. The loop may be closed by now."""
        self._next.cancel()
