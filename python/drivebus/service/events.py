"""What happened to drives and lines: told to the log as it happens, and kept among the samples for all others.

A drive is compared with what it said before; what is the same is told once.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from drivebus.sinks.picture import DrivePicture
from drivebus.spool import Spool

__all__ = ["KINDS", "Event", "Events"]

KINDS = {
    "gone": "a drive does not answer any more",
    "back": "it answers again",
    "fault": "it is in a fault",
    "cleared": "it is in none any more",
    "state": "it does something else",
    "open": "a line is served",
    "away": "the port of a line cannot be used",
    "told": "something of a line or its clients that people should know",
    "order": "somebody told a drive to do something, and what became of it",
}
"""The kinds of events, and what each means."""

_REMEMBERED = 500
"""So many are there for who comes later."""
_LONGEST = 1_000
"""Characters of one."""


class Event(NamedTuple):
    """Something that happened.

    Attributes:
        time: Unix time in seconds.
        subject: The drive or the line.
        kind: One of `KINDS`.
        text: What happened, in words.
    """

    time: float
    subject: str
    kind: str
    text: str


class Events:
    """What happened since a service began. Any thread.

    Args:
        tell: Hears of each in words, line by line.
        spool: Where they are kept, if there is one.
        clock: Unix time in seconds.
    """

    def __init__(
        self, tell: Callable[[str], None], spool: Spool | None, clock: Callable[[], float] = time.time
    ) -> None:
        self._tell = tell
        self._spool = spool
        self._clock = clock
        self._lock = threading.Lock()
        self._last: deque[Event] = deque(maxlen=_REMEMBERED)
        self._seen: dict[str, DrivePicture] = {}

    def note(self, subject: str, kind: str, text: str, at: float | None = None) -> None:
        """It happened, at the Unix time *at*, or now."""
        event = Event(self._clock() if at is None else at, subject, kind, text[:_LONGEST])
        with self._lock:
            self._last.append(event)
        self._tell(f"{subject}: {text}")
        if self._spool is not None:
            self._spool.note(subject, kind, event.time, event.text)

    def last(self) -> list[Event]:
        """The last ones, the oldest first."""
        with self._lock:
            return list(self._last)

    def saw(self, said: DrivePicture) -> None:
        """A drive *said* that, in one of its polls."""
        with self._lock:
            before = self._seen.get(said.layout.drive)
            self._seen[said.layout.drive] = said
        for kind, text in _news(before, said):
            self.note(said.layout.drive, kind, text, said.time)


def _news(before: DrivePicture | None, now: DrivePicture) -> list[tuple[str, str]]:
    """What *now* says that *before* did not; of a drive that was not asked before, what is out of the ordinary."""
    if now.missing:
        is_news = before is None or not before.missing
        return [("gone", f"gives no values: {now.missing}")] if is_news else []
    told: list[tuple[str, str]] = []
    fault, doing = ("", "") if before is None else (before.fault, before.state)
    if before is not None and before.missing:
        told.append(("back", f"answers again{': ' + now.state if now.state else ''}"))
    if now.fault != fault:
        told.append(("fault", f"in fault: {now.fault}") if now.fault else ("cleared", f"out of fault: {now.state}"))
    elif doing and now.state and now.state != doing:
        told.append(("state", f"{doing}, now {now.state}"))
    return told
