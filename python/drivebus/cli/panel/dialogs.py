"""The dialogs: what asks before a motor moves, what asks for a number or a file, and the help."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from drivebus.cli.panel.line_field import LineField
from drivebus.cli.present.output import printable

__all__ = ["Ask", "AskFor", "Show"]

_STOP = Text("Space stops the motor, also now.", "dim")


class Ask(ModalScreen[str]):
    """A question that is answered by one key: no answer is a habit, as Enter would be.

    Gives the key; an empty text is no.

    Args:
        text: What would be done, and to which drive.
        answers: What each key means. n and Escape are no.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape,n,q", "dismiss('')", "no")]

    def __init__(self, text: str, answers: Mapping[str, str]) -> None:
        super().__init__()
        self._text = text
        self._answers = answers

    def compose(self) -> ComposeResult:
        """The question, and the keys."""
        keys = Text()
        for key, meaning in {**self._answers, "n": "no (Escape, q too)"}.items():
            keys.append(f" {key} ", "reverse bold").append(f" {meaning}   ")
        with Vertical(classes="dialog"):
            yield Static(Text(printable(self._text)))
            yield Static(keys, classes="keys")
            yield Static(_STOP)

    def key_y(self) -> None:
        """Yes."""
        self._give("y")

    def key_e(self) -> None:
        """To EEPROM, where that is asked."""
        self._give("e")

    def _give(self, key: str) -> None:
        if key in self._answers:
            self.dismiss(key)


class AskFor(ModalScreen[str]):
    """Asks for a text of one line. Gives it; an empty text is none.

    Args:
        text: What is asked for.
        value: What stands there first.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss('')", "cancel")]

    def __init__(self, text: str, value: str = "") -> None:
        super().__init__()
        self._text = text
        self._value = value

    def compose(self) -> ComposeResult:
        """The question, and the line."""
        with Vertical(classes="dialog"):
            yield Static(Text(printable(self._text)))
            yield LineField(self._value)
            yield Static(Text("Enter goes on, Escape cancels, q is typed. ", "dim").append_text(_STOP))

    def on_line_field_submitted(self, event: LineField.Submitted) -> None:
        """Goes on with what was typed."""
        self.dismiss(event.value.strip())


class Show(ModalScreen[None]):
    """A text to read, such as the help. Any of its keys closes it.

    Args:
        text: What is shown.
    """

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape,q,enter,question_mark,m", "dismiss", "close")]

    def __init__(self, text: Text) -> None:
        super().__init__()
        self._text = text

    def compose(self) -> ComposeResult:
        """The text, in a box that scrolls."""
        page = VerticalScroll(classes="page")
        page.border_subtitle = "Escape or q closes"
        with page:
            yield Static(self._text)
