"""The loop that every sink has: wait, read, deliver; and after a failure say why, pause, and begin anew.

Where a sink stands is asked of the destination each time. What this program or the spool remembers may be wrong: the
one knows nothing of a commit whose answer was lost, and the other may have lost its end.
"""

from __future__ import annotations

import sqlite3
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from typing import Any, Protocol

from drivebus.sinks.intervals import Intervals
from drivebus.sinks.lanes import Lanes
from drivebus.spool import Reader, Spool, Spooled

__all__ = ["Delivery", "Destination"]

_FIRST_PAUSE, _LONGEST_PAUSE = 1.0, 60.0
"""Seconds between two attempts."""
_LOOKS = 0.25
"""Seconds for which the spool is waited at, until this looks whether it shall end."""
_REST = 0.05
"""Seconds until a spool is waited at again that let nobody wait: it is closed."""
_GRACE = 0.4
"""Seconds for a delivery that is under way when all shall end, and again after it was broken off."""
_QUICK, _SLOW = 0.05, 0.15
"""Seconds that a delivery takes: so many samples go at a time that it is between these."""
_BEGINS_WITH, _MOST = 500, 10_000
"""Samples at a time."""


class Destination(Protocol):
    """Where samples go. Used by one thread, but for `interrupt`."""

    name: str
    """What people call it."""

    def open(self) -> Mapping[str, Intervals]:
        """Connects, and tells what is in, by the names of the epochs."""

    def put(self, samples: Sequence[Spooled]) -> None:
        """Takes *samples*, all or none; they are kept when this returns."""

    def check(self) -> None:
        """Raises why it takes nothing any more, where that is known without asking."""

    def interrupt(self) -> None:
        """Whatever `open` or `put` waits for is over, from now on. Any thread."""

    def close(self) -> None:
        """Disconnects; after a failure, too."""


class Delivery:
    """Delivers what is in a spool to one destination, in a thread of its own.

    Args:
        spool: What is delivered.
        sink: The name under which the spool is told how far it has got, for its statistics.
        destination: Where to.
        tell: Hears in words what people should know.
    """

    def __init__(self, spool: Spool, sink: str, destination: Destination, tell: Callable[[str], None]) -> None:
        self._spool = spool
        self._sink = sink
        self._destination = destination
        self._tell = tell
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"drivebus {sink}", daemon=True)
        self._pause = _FIRST_PAUSE
        self._limit = _BEGINS_WITH
        self._told: set[str] = set()
        self._why = "it was not tried yet"
        self._lanes: Lanes | None = None
        self._position = 0
        self._delivered = 0

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def close(self) -> None:
        """Ends within a second; what is not in stays in the spool. Closing again does nothing."""
        self._closing.set()
        if self._thread.ident is None:
            return
        self._thread.join(_GRACE)
        if self._thread.is_alive():
            self._destination.interrupt()
            # One that asks for the address of a host cannot be broken off. It ends by itself, and delivers nothing.
            self._thread.join(_GRACE)

    def status(self) -> dict[str, Any]:
        """How it does: whether it is connected, why not, how many samples are not in yet, and how many it delivered."""
        last, lanes = self._spool.last, self._lanes
        return {
            "connected": not self._why,
            "why": self._why,
            "behind": max(last - self._position, 0) if lanes is None else lanes.behind(last),
            "delivered": self._delivered,
        }

    def _run(self) -> None:
        while not self._closing.is_set():
            try:
                with closing(self._spool.reader(self._sink)) as reader, closing(self._destination):
                    self._serve(reader)
            except sqlite3.Error as error:
                self._fail(f"the spool cannot be read: {error}")
            except Exception as error:  # whatever it is, samples wait, and one more attempt may help
                self._fail(str(error) or type(error).__name__)

    def _fail(self, why: str) -> None:
        if self._closing.is_set():
            return
        self._why = why
        if why not in self._told:
            self._told.add(why)
            self._tell(f"no samples reach {self._destination.name}: {why}. They wait, and it is tried again")
        # A smaller part may be taken where a larger one takes too long.
        self._limit = max(min(self._limit, _BEGINS_WITH) // 2, 1)
        self._closing.wait(self._pause)
        self._pause = min(self._pause * 2, _LONGEST_PAUSE)

    def _serve(self, reader: Reader) -> None:
        if self._lanes is None:
            self._position = reader.position()
        inside = self._destination.open()
        lanes = self._lanes = Lanes(reader.stretches(), inside)
        self._why = ""
        told, due = -1, 0.0
        while not self._closing.is_set():
            self._destination.check()
            if lanes.contiguous != told:
                told = lanes.contiguous
                reader.reached(told)
            fresh = lanes.present(reader, self._spool.last, self._limit)
            if fresh:
                self._deliver(fresh)
                lanes.was_present(fresh)
                continue
            rest = _LOOKS
            if lanes.has_backlog:
                rest = due - time.monotonic()
                if rest <= 0.0:
                    began = time.monotonic()
                    waited = lanes.backlog(reader, self._limit)
                    if waited:
                        self._deliver(waited)
                        lanes.was_backlog(waited)
                    # It rests for as long as it took: half of what the destination can do is for the present.
                    due = 2 * time.monotonic() - began
                    continue
            until = time.monotonic() + min(rest, _LOOKS)
            if not reader.wait(lanes.head, min(rest, _LOOKS)) and time.monotonic() < until:
                self._closing.wait(_REST)

    def _deliver(self, samples: Sequence[Spooled]) -> None:
        began = time.monotonic()
        self._destination.put(samples)
        took = time.monotonic() - began
        self._delivered += len(samples)
        self._pause = _FIRST_PAUSE
        if self._told:
            self._told.clear()
            self._tell(f"samples reach {self._destination.name} again")
        if self._limit < _BEGINS_WITH:
            self._limit = min(self._limit * 2, _BEGINS_WITH)
        elif took > _SLOW:
            # No smaller: over a long way even a single sample is slow.
            self._limit = max(self._limit // 2, _BEGINS_WITH)
        elif took < _QUICK and len(samples) >= self._limit:
            self._limit = min(self._limit * 2, _MOST)
