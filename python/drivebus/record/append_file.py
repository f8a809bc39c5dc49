"""A file that is only ever appended to, whole pieces at a time."""

from __future__ import annotations

import os
from pathlib import Path

from drivebus.capture.standing import Standing

__all__ = ["Appended"]

_PIECE = 1 << 20
"""Bytes that are copied at once."""


class Appended:
    """Text that grows by whole pieces: one that does not fit on the disk is taken back.

    Args:
        path: The file, which must not be there.

    Raises:
        OSError: It cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = _made(path)
        self._standing = Standing(path, os.fstat(self._file))
        self._length = 0

    def append(self, text: str) -> None:
        """Writes *text*, all of it or nothing.

        Raises:
            OSError: There is no room, or the disk is gone.
        """
        data = text.encode("utf-8", "backslashreplace")
        try:
            _put(self._file, data)
        except OSError:
            # Half a line would be taken for a whole one.
            os.ftruncate(self._file, self._length)
            os.lseek(self._file, self._length, os.SEEK_SET)
            raise
        self._length += len(data)

    def size(self) -> int:
        """Bytes that it has."""
        return self._length

    def gone(self) -> str:
        """Why it does not stand at its path any more; empty while it does."""
        return self._standing.gone()

    def move(self, path: Path) -> int | None:
        """Goes on in a new file at *path*, with all that it has: it is still open, wherever its name has gone.

        Returns:
            0: nothing is lost. None: what it has cannot be read any more; nothing was made.

        Raises:
            OSError: There is something at *path*, or no room; nothing was made.
        """
        new = _made(path)
        try:
            if not self._copy(new):
                os.close(new)
                path.unlink(missing_ok=True)
                return None
        except OSError:
            os.close(new)
            path.unlink(missing_ok=True)
            raise
        os.close(self._file)
        self.path, self._file, self._standing = path, new, Standing(path, os.fstat(new))
        return 0

    def close(self) -> None:
        """Ends it."""
        os.close(self._file)

    def _copy(self, to: int) -> bool:
        """Writes all to another file; whether it could be read."""
        done = 0
        while done < self._length:
            try:
                os.lseek(self._file, done, os.SEEK_SET)
                piece = os.read(self._file, min(_PIECE, self._length - done))
            except OSError:
                piece = b""
            if not piece:
                os.lseek(self._file, self._length, os.SEEK_SET)
                return False
            try:
                _put(to, piece)
            except OSError:
                os.lseek(self._file, self._length, os.SEEK_SET)
                raise
            done += len(piece)
        return True


def _made(path: Path) -> int:
    return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)


def _put(file: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(file, rest) :]
