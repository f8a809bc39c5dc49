"""The folder where programs of one user meet on this computer."""

from __future__ import annotations

import sys
from pathlib import Path

from drivebus import _native
from drivebus.errors import NotAllowed

__all__ = ["run_time_folder"]


def run_time_folder() -> Path:
    """The folder for the sockets of this user, made where it is missing; nobody else can look into it.

    Raises:
        NotAllowed: The system has no such sockets, or there is no folder that is this user's alone.
    """
    if sys.platform == "win32":
        raise NotAllowed("programs of one computer meet at a Unix socket, and Python has none on this system")
    try:
        return Path(_native.run_time_folder())
    except OSError as error:
        raise NotAllowed(f"programs of one user meet in a folder of their own, and there is none: {error}") from error
