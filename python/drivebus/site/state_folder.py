"""Where a program keeps what it remembers of its user between runs.

A stop needs it before it sends anything, so nothing large is loaded: `os.path` is there already, and `pathlib` is not.
"""

from __future__ import annotations

import os
import sys

__all__ = ["state_file"]


def state_file(name: str) -> str:
    """The path of the file *name* in the folder of this user's state. Neither has to exist."""
    home = os.path.expanduser("~")
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or os.path.join(home, "AppData", "Local")
    elif sys.platform == "darwin":
        base = os.path.join(home, "Library", "Application Support")
    else:
        base = os.environ.get("XDG_STATE_HOME") or os.path.join(home, ".local", "state")
    return os.path.join(base, "drivebus", name)
