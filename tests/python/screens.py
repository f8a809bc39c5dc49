"""A real terminal around a program: what a person would see of it, at the size of their window."""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyte

__all__ = ["SIZES", "Seen", "on_a_terminal"]

SIZES = [(80, 24), (200, 50)]
"""Columns and lines of a window."""


@dataclass
class Seen:
    """What a program left on the terminal.

    Attributes:
        code: What it ended with.
        raw: All that it wrote.
        lines: The lines of the screen and of what was scrolled out above, without blanks at their ends.
        shown: The screen as it was when it was asked for, if it was.
    """

    code: int
    raw: str
    lines: list[str]
    shown: list[str]

    @property
    def text(self) -> str:
        """The lines as one text."""
        return "\n".join(self.lines)


def on_a_terminal(
    words: Sequence[str],
    size: tuple[int, int],
    environment: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    until: Callable[[list[str]], bool] | None = None,
) -> Seen:
    """Runs `drivebus` with *words* on a terminal of *size* to its end; with *until*, Ctrl-C when the screen is so."""
    columns, rows = size
    screen = pyte.HistoryScreen(columns, rows, history=5000, ratio=0.5)
    stream = pyte.ByteStream(screen)
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
    program = subprocess.Popen(
        [sys.executable, "-m", "drivebus", *words],
        stdin=follower,
        stdout=follower,
        stderr=follower,
        env={**kept, "TERM": "xterm-256color", **(environment or {})},
        cwd=cwd,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(follower, termios.TIOCSCTTY, 0),
    )
    os.close(follower)
    raw, shown, waits = b"", [], until
    presses = 0
    while True:
        ready, _, _ = select.select([leader], [], [], 2 if 0 < presses < 30 else 60)
        if not ready and 0 < presses < 30:
            # One that comes between a prompt and the reading behind it waits for the next key; people press again.
            presses += 1
            os.write(leader, b"\x03")
            continue
        try:
            piece = os.read(leader, 65536) if ready else b""
        except OSError:  # the program has closed it
            piece = b""
        if not piece:
            break
        raw += piece
        stream.feed(piece)
        if waits is not None and waits([line.rstrip() for line in screen.display]):
            shown, waits = [line.rstrip() for line in screen.display], None
            presses = 1
            os.write(leader, b"\x03")
    code = program.wait(60)
    os.close(leader)
    scrolled = ["".join(line[at].data for at in range(columns)).rstrip() for line in screen.history.top]
    lines = [*scrolled, *(line.rstrip() for line in screen.display)]
    while lines and not lines[-1]:
        lines.pop()
    return Seen(code, raw.decode("utf-8", "replace"), lines, shown)
