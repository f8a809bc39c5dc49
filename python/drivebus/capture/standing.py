"""Whether a file that is written still stands where it was made: others remove, rename and replace files."""

from __future__ import annotations

import os
import stat
from pathlib import Path

__all__ = ["LOOK", "Standing"]

LOOK = 1.0
"""Seconds between two looks whether a file stands there still."""


class Standing:
    """One file at its place, told from others by its device and its inode. What is no file never goes.

    Args:
        path: Where it was made. Another working folder later changes nothing.
        status: What the system says of the open file.
    """

    def __init__(self, path: Path, status: os.stat_result) -> None:
        self._path = path.absolute()
        self._is = (status.st_dev, status.st_ino)
        self._is_a_file = stat.S_ISREG(status.st_mode)

    def gone(self) -> str:
        """Why the file does not stand there any more; empty while it does, or where the system cannot tell."""
        if not self._is_a_file:
            return ""
        try:
            there = self._path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return "it was removed or renamed" if self._path.parent.is_dir() else "its folder was removed or renamed"
        except OSError:
            return ""
        return "" if (there.st_dev, there.st_ino) == self._is else "another file stands there"
