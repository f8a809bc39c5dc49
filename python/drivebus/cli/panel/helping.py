"""The texts of the help and of the messages."""

from __future__ import annotations

from rich.text import Text

from drivebus.cli.panel.journal import Journal

__all__ = ["help_text", "journal_text"]

_HELP = [
    ("Space", "STOP, in every view, dialog and text field: the drive in view, and every motor that this panel started"),
    ("s", "stops the drive in view, and no other"),
    ("r, R", "runs the motor forward, in reverse; changes speed or direction of a motor that turns"),
    ("j, J", "jogs the motor forward, in reverse, for some seconds"),
    ("f", "changes the setpoint"),
    ("x", "resets a fault"),
    ("b", "prepares the drive: sets it to obey the bus, in RAM. Says what it would write, and asks"),
    ("p", "parameters: look, search, change, compare with a backup"),
    ("m", "all messages"),
    ("Enter", "in the overview: looks at the drive under the cursor"),
    ("arrows", "choose the drive"),
    ("PageDown", "in the view of one drive: the values that did not fit"),
    ("Escape", "goes back; no to a question"),
    ("q, Ctrl-C", "end the panel"),
]

_MORE = """
What moves a motor asks first, and only y is yes. A stop asks nothing.

What this panel started it stops when it ends, however it ends: q, Ctrl-C, a closed terminal, SIGTERM. Only kill -9 and
a computer without power stop nothing: for those there is --watchdog.

A motor that was started elsewhere goes on when the panel ends.

? behind a value: not verified. ! behind a value: assumed. `drivebus describe NAME` says why.

The numbers behind a trend are its lowest and its highest value.

An emergency stop is a wire."""


def help_text() -> Text:
    """The keys, and what to know."""
    told = Text("Keys\n\n", "bold")
    for key, meaning in _HELP:
        told.append(f"{key:<10}", "bold red" if key == "Space" else "bold").append(f" {meaning}\n")
    return told.append(_MORE.replace("\n\n", "\0").replace("\n", " ").replace("\0", "\n\n").lstrip(" "))


def journal_text(journal: Journal) -> Text:
    """All messages, the newest first."""
    told = Text("Messages, the newest first\n\n", "bold")
    for line in reversed(journal.lines()):
        told.append(f"{line.when:%H:%M:%S} ", "dim").append(f"{line.text}\n", line.style)
    return told
