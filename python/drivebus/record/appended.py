"""A file that is only ever appended to, whole pieces at a time."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["Appended"]


class Appended:
    """Text that grows by whole pieces: one that does not fit on the disk is taken back.

    Args:
        path: The file, which must not be there.

    Raises:
        OSError: It cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
        self._length = 0

    def append(self, text: str) -> None:
        """Writes *text*, all of it or nothing.

        Raises:
            OSError: There is no room, or the disk is gone.
        """
        rest = memoryview(text.encode("utf-8", "backslashreplace"))
        whole = len(rest)
        try:
            while rest:
                rest = rest[os.write(self._file, rest) :]
        except OSError:
            # Half a line would be taken for a whole one.
            os.ftruncate(self._file, self._length)
            os.lseek(self._file, self._length, os.SEEK_SET)
            raise
        self._length += whole

    def size(self) -> int:
        """Bytes that it has."""
        return self._length

    def close(self) -> None:
        """Ends it."""
        os.close(self._file)
