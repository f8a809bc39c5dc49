"""Whether a file that is written still stands where it was made: others remove, rename and replace files."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["Standing"]


class Standing:
    """One file at its place, told from others by its device and its inode.

    Args:
        path: Where it was made. Another working folder later changes nothing.
        status: What the system says of the open file.
    """

    def __init__(self, path: Path, status: os.stat_result) -> None:
        self._path = path.absolute()
        self._is = (status.st_dev, status.st_ino)

    def gone(self) -> str:
        """Why the file does not stand there any more; empty while it does, or where the system cannot tell."""
        try:
            there = self._path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return "it was removed or renamed" if self._path.parent.is_dir() else "its folder was removed or renamed"
        except OSError:
            return ""
        return "" if (there.st_dev, there.st_ino) == self._is else "another file stands there"
