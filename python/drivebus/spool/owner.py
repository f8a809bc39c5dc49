"""Whose a spool is: one program's at a time, by a lock that ends with it on every system."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from drivebus.errors import NotAllowed

__all__ = ["owned"]


def owned(path: Path) -> sqlite3.Connection:
    """Has the file at *path* for this program alone, until it is closed or the program ends.

    Two that write would mix their epochs, and whoever reads relies on one after the other.

    Raises:
        NotAllowed: Another program has it.
    """
    beside = path.with_name(f"{path.name}-owner")
    if not beside.exists():
        beside.touch(0o600)
    base = sqlite3.connect(beside, isolation_level=None, check_same_thread=False, timeout=0.0)
    try:
        base.execute("BEGIN EXCLUSIVE")
    except sqlite3.OperationalError as error:
        base.close()
        why = "another program has it" if "locked" in str(error) else str(error)
        raise NotAllowed(f"the spool {path} cannot be opened: {why}") from None
    return base
