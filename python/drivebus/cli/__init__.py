"""The command `drivebus`: everything a technician needs in front of a drive, over the public API only.

Each part is loaded when it is needed: a stop does not wait for what only tables need, and `--version` needs no part.
"""

from __future__ import annotations

import gc
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

import drivebus
from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.cli.app import cli

__all__ = ["cli", "main"]

_HALTS = {"stop", "coast"}
"""Commands that are not to wait until the families are worked out: that goes on while the program is loaded."""


_ALLOCATIONS_BEFORE_A_LOOK = 100_000
"""So many are made before garbage is looked for. At the 700 of Python the command takes a tenth longer to load."""


def main() -> None:
    """The entry point of the command."""
    gc.set_threshold(_ALLOCATIONS_BEFORE_A_LOOK)
    if sys.argv[1:] == ["--version"] and _told_version():
        return
    if not _HALTS.isdisjoint(sys.argv):
        # Why the core cannot be loaded is told by whoever needs it.
        with suppress(ImportError):
            from drivebus.line.early_families import begin_families

            begin_families()
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
