"""A password in a file of its own, which only its owner may read. No message repeats it."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from drivebus.errors import NotAllowed

__all__ = ["password_in"]


def password_in(path: Path) -> str:
    """The first line of the file at *path*.

    Raises:
        NotAllowed: It cannot be read, or others may read it, too.
    """
    try:
        with path.open(encoding="utf-8") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            password = file.readline().rstrip("\r\n")
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise NotAllowed(f"the password in {path} cannot be read: {why}") from None
    if os.name == "posix" and mode & 0o077:
        raise NotAllowed(f"others may read the password in {path}: run chmod 600 {path}")
    return password
