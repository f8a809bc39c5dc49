"""The command `drivebus`: everything a technician needs in front of a drive, over the public API only.

Each part is loaded when it is needed: a stop does not wait for what only tables need, and `--version` needs no part.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import drivebus
from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.cli.app import cli

__all__ = ["cli", "main"]


def main() -> None:
    """The entry point of the command."""
    if sys.argv[1:] == ["--version"] and _told_version():
        return
    from drivebus.cli import app

    app.main()


def _told_version() -> bool:
    """Prints the version, as the whole program would. What cannot be shown is left to that."""
    try:
        print(f"drivebus, version {drivebus.__version__}", flush=True)
    except OSError:
        return False
    return True


if not TYPE_CHECKING:
    __getattr__ = later(__name__, {"app": ("cli",)})
