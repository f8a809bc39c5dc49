"""The panel in a real terminal, as a person has it: keys go in, and what comes is a screen that can be read.

The simulated drives live in this process and the panel in another. What the panel's bus sends and what its keys do is
kept in one file, in the order in which it happened.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pyte

__all__ = ["Terminal", "on_a_terminal"]

_LIMIT = 20.0
"""Seconds after which a screen that did not come is an error: the test's own, and nothing is judged by it."""

LOGGED = """
import logging, sys
exec(sys.argv.pop(1))
logging.basicConfig(filename=sys.argv.pop(1), format="%(name)s %(message)s")
for name in ("drivebus.panel", "drivebus.wire"):
    logging.getLogger(name).setLevel(logging.DEBUG)
from drivebus.cli import main
main()
"""
"""The command line, after what stands first, with a record of keys and frames in the file that stands next."""


class Terminal:
    """A window, and the program in it."""

    def __init__(
        self, program: Sequence[str], size: tuple[int, int], environment: Mapping[str, str], log: Path
    ) -> None:
        columns, rows = size
        self.raw = b""
        self.log = log
        self._screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self._screen)
        self._leader, follower = pty.openpty()
        fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        kept = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
        self.child = subprocess.Popen(
            [sys.executable, *program],
            stdin=follower,
            stdout=follower,
            stderr=follower,
            env={**kept, "TERM": "xterm-256color", **environment},
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(follower, termios.TIOCSCTTY, 0),
        )
        os.close(follower)

    @property
    def lines(self) -> list[str]:
        """The screen now, without blanks at the ends of its lines."""
        return [line.rstrip() for line in self._screen.display]

    def styled(self) -> Iterator[list[tuple[str, str]]]:
        """The screen as lines of letters, each with its style in rich's words."""
        for row in range(self._screen.lines):
            line = self._screen.buffer[row]
            yield [(line[at].data, _style(line[at])) for at in range(self._screen.columns)]

    @property
    def text(self) -> str:
        """The screen as one text."""
        return "\n".join(self.lines)

    @property
    def words(self) -> str:
        """The words on the screen, wherever a line ends and a box has its sides."""
        return " ".join(re.sub("[│┌┐└┘─╭╮╰╯]", " ", self.text).split())

    def press(self, *keys: str) -> None:
        """Presses keys, one after the other."""
        for key in keys:
            os.write(self._leader, key.encode())

    def until(self, *shown: str | Callable[[str], bool]) -> None:
        """Waits until the screen shows all of *shown*."""
        limit = time.monotonic() + _LIMIT
        for each in shown:
            wanted = each if callable(each) else lambda text, words=each: words in text
            while not wanted(self.words):
                if not self._read() or time.monotonic() > limit:
                    raise AssertionError((each, self.text))

    def take(self, seconds: float) -> None:
        """Takes what the program writes within *seconds*, if it writes anything."""
        if select.select([self._leader], [], [], seconds)[0]:
            self._read()

    def without(self, *gone: str) -> None:
        """Waits until the screen shows none of *gone*."""
        self.until(*(lambda text, words=words: words not in text for words in gone))

    def ends(self) -> int:
        """Waits for the end of the program: its exit code."""
        while self._read():
            pass
        return self.child.wait(_LIMIT)

    def send(self, number: int) -> None:
        """Sends a signal to the program."""
        self.child.send_signal(number)

    def hang_up(self) -> None:
        """Closes the window."""
        os.close(self._leader)
        self._leader = -1

    def close(self) -> None:
        """What a test that failed left behind."""
        self.child.kill()
        self.child.wait()
        if self._leader >= 0:
            os.close(self._leader)

    def record(self) -> list[str]:
        """Keys and frames so far, in their order."""
        return self.log.read_text(encoding="utf-8").splitlines()

    def _read(self) -> bool:
        """Takes what the program writes next; whether there was anything."""
        if self._leader < 0:
            return False
        ready, _, _ = select.select([self._leader], [], [], _LIMIT)
        try:
            piece = os.read(self._leader, 65536) if ready else b""
        except OSError:  # the program has closed it
            piece = b""
        self.raw += piece
        self._stream.feed(piece)
        return bool(piece)


def _style(letter: pyte.screens.Char) -> str:
    """How *letter* looks."""

    def colour(name: str) -> str:
        name = {"brown": "yellow"}.get(name.removeprefix("bright"), name.removeprefix("bright"))
        return "default" if name == "default" else f"#{name}" if re.fullmatch("[0-9a-f]{6}", name) else name

    front, back = (letter.bg, letter.fg) if letter.reverse else (letter.fg, letter.bg)
    return f"{'bold ' if letter.bold else ''}{colour(front)} on {colour(back)}"


@contextlib.contextmanager
def on_a_terminal(
    words: Sequence[str],
    log: Path,
    size: tuple[int, int] = (80, 24),
    before: str = "",
    quiet: bool = False,
    environment: Mapping[str, str] | None = None,
) -> Iterator[Terminal]:
    """`drivebus` with *words* in a window of *size*.

    What stands in *before* is done first. *quiet* keeps no record, which the program would pay for.
    """
    program = ["-m", "drivebus", *words] if quiet else ["-c", LOGGED, before, str(log), *words]
    terminal = Terminal(program, size, environment or {}, log)
    try:
        yield terminal
    finally:
        terminal.close()
