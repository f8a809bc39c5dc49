"""A program on a terminal of its own that a test talks with: what it says is waited for, and answered."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import subprocess
import sys
import termios

__all__ = ["Conversation"]


class Conversation:
    """`drivebus` on a terminal of its own, which it has until the end of a `with` block."""

    def __init__(self, *words: str, terminal: str = "dumb") -> None:
        self._leader, follower = pty.openpty()
        self._program = subprocess.Popen(
            [sys.executable, "-m", "drivebus", *words],
            stdin=follower,
            stdout=follower,
            stderr=follower,
            env={**os.environ, "TERM": terminal, "COLUMNS": "200"},
            start_new_session=True,
            preexec_fn=lambda: _control(follower),
        )
        os.close(follower)
        self.text = ""
        self._seen = 0

    def __enter__(self) -> Conversation:
        return self

    def __exit__(self, *_: object) -> None:
        if self._program.poll() is None:
            self._program.kill()
            self._program.wait()
            os.close(self._leader)

    def until(self, pattern: str) -> str:
        """Waits for *pattern* in what comes next, and returns that."""
        while (match := re.search(pattern, self.text[self._seen :])) is None:
            ready, _, _ = select.select([self._leader], [], [], 60)
            assert ready, f"{pattern!r} does not come:\n{self.text}"
            self.text += os.read(self._leader, 65536).decode()
        came = self.text[self._seen : self._seen + match.end()]
        self._seen += match.end()
        return came

    def say(self, text: str, until: str = "raw> ") -> str:
        os.write(self._leader, text.encode())
        return self.until(until)

    def end(self, last: str = "\x04") -> int:
        """Types *last*, which is Ctrl-D, and returns the exit code."""
        os.write(self._leader, last.encode())
        while select.select([self._leader], [], [], 60)[0]:
            try:
                self.text += os.read(self._leader, 65536).decode()
            except OSError:
                break
        os.close(self._leader)
        return self._program.wait(60)


def _control(terminal: int) -> None:
    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
