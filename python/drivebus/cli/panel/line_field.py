"""A line to type into that takes keys in the order in which they come.

textual's own Input hands Backspace and Enter to bindings, behind the letters that follow them: what comes in a lump, as
over a slow ssh, is then another number than the one that was typed.
"""

from __future__ import annotations

from rich.text import Text
from textual.events import Key, Paste
from textual.message import Message
from textual.widgets import Static

__all__ = ["LineField"]


class LineField(Static, can_focus=True):
    """One line of text. What stands there first is replaced by the first letter, unless a key moves the cursor before.

    Args:
        value: What stands there first.
        hint: What is shown where nothing stands.
        name: Its name on the screen.

    Attributes:
        value: What stands there.
    """

    class Changed(Message):
        """Something else stands there now."""

        def __init__(self, value: str) -> None:
            super().__init__()
            self.value = value

    class Submitted(Message):
        """Enter was pressed."""

        def __init__(self, value: str) -> None:
            super().__init__()
            self.value = value

    def __init__(self, value: str = "", hint: str = "", name: str | None = None) -> None:
        super().__init__(id=name)
        self.value = value
        self._hint = hint
        self._at = len(value)
        self._is_first = True

    def on_mount(self) -> None:
        """Shows it."""
        self._draw()

    def watch_has_focus(self, has_focus: bool) -> None:
        """Shows the cursor, or hides it."""
        super().watch_has_focus(has_focus)
        self._draw()

    def on_key(self, event: Key) -> None:
        """Takes a key that is meant for it."""
        before = self.value
        if event.key == "enter":
            self.post_message(self.Submitted(self.value))
        elif event.is_printable and event.character is not None:
            self._insert(event.character)
        elif not self._edit(event.key):
            return
        event.stop()
        event.prevent_default()
        self._tell(before)

    def on_paste(self, event: Paste) -> None:
        """Takes the first line of what was pasted."""
        before = self.value
        event.stop()
        self._insert((event.text.splitlines() or [""])[0])
        self._tell(before)

    def _insert(self, text: str) -> None:
        if self._is_first:
            self.value, self._at = "", 0
        self._is_first = False
        self.value = self.value[: self._at] + text + self.value[self._at :]
        self._at += len(text)

    def _edit(self, key: str) -> bool:
        """Does what *key* is for; whether that is anything."""
        if key == "backspace":
            if self._is_first:
                self._at = len(self.value)
            cut = max(self._at - 1, 0)
            self.value, self._at = self.value[:cut] + self.value[self._at :], cut
        elif key == "delete":
            self.value = self.value[: self._at] + self.value[self._at + 1 :]
        elif key == "ctrl+u":
            self.value, self._at = "", 0
        elif key in ("left", "right", "home", "end"):
            places = {"left": self._at - 1, "right": self._at + 1, "home": 0, "end": len(self.value)}
            self._at = min(max(places[key], 0), len(self.value))
        else:
            return False
        self._is_first = False
        return True

    def _tell(self, before: str) -> None:
        self._draw()
        if self.value != before:
            self.post_message(self.Changed(self.value))

    def _draw(self) -> None:
        if not self.has_focus:
            self.update(Text(self.value) if self.value else Text(self._hint, "dim"))
            return
        shown = Text("> ", "bold").append(f"{self.value} ", "underline")
        shown.stylize("reverse", 2 + self._at, 3 + self._at)
        self.update(shown)
