"""What the panel has to say: what was ordered, what came of it, and why not. Any thread may tell it.

Each line also goes to the logger `drivebus.panel`, for whoever keeps a record of who did what.
"""

from __future__ import annotations

import logging
from collections import deque
from datetime import datetime
from typing import NamedTuple

import drivebus
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import printable

__all__ = ["LOGGER", "Journal", "JournalLine"]

LOGGER = "drivebus.panel"
"""The logger that has a record of level INFO for each line."""

_KEPT = 500


class JournalLine(NamedTuple):
    """One line: when, what, and in which style."""

    when: datetime
    text: str
    style: str


class Journal:
    """The latest lines, the newest last.

    Attributes:
        count: How many there were so far: who looks sees by it whether there are more.
    """

    def __init__(self) -> None:
        self._lines: deque[JournalLine] = deque(maxlen=_KEPT)
        self._logger = logging.getLogger(LOGGER)
        self.count = 0

    def say(self, text: str, style: str = "") -> None:
        """Tells *text*."""
        shown = printable(text)
        self._logger.info("%s", shown)
        self._lines.append(JournalLine(datetime.now(), shown, style))
        self.count += 1

    def fail(self, what: str, error: drivebus.DrivebusError) -> None:
        """Tells that *what* failed."""
        notes = getattr(error, "__notes__", ())
        self.say(f"{what}: {'; '.join(in_commands(part) for part in (error, *notes))}", "bold red")

    def trace(self, error: Exception) -> None:
        """Has the logger alone keep where *error*, which nobody foresaw, came from."""
        self._logger.debug("it ends by a mistake of its own", exc_info=error)

    def lines(self) -> list[JournalLine]:
        """All that are kept."""
        return list(self._lines)
