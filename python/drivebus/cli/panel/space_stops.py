"""The terminal's driver, with one key taken out before the screen's own work: Space stops, whatever the screen does.

A driver reads keys in a thread of its own. What it finds there goes out at once, even if the screen is being drawn.
"""

from __future__ import annotations

from collections.abc import Callable

from textual.driver import Driver
from textual.events import Key
from textual.message import Message

__all__ = ["STOP_KEYS", "stopping"]

STOP_KEYS = ("space", "shift+space", "ctrl+space", "ctrl+@")
"""What Space is, as terminals send it."""


def stopping(driver: type[Driver], stop: Callable[[], None], lost: Callable[[], None]) -> type[Driver]:
    """A driver like *driver* that calls *stop* for Space, and *lost* where the terminal is gone, in its own thread."""

    class Stopping(driver):  # type: ignore[valid-type, misc]
        def process_message(self, message: Message) -> None:
            if isinstance(message, Key) and message.key in STOP_KEYS:
                stop()
            super().process_message(message)

        def run_input_thread(self) -> None:
            try:
                super().run_input_thread()
            except OSError:
                lost()

    return Stopping
