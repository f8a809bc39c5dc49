"""Samples on their way to others: kept in a file until each of them has them, whatever ends in between.

Nothing here asks a drive, and nothing knows where samples go.
"""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.spool.layout import Layout
    from drivebus.spool.store import Reader, Spool, Spooled, Stretch

__all__ = ["Layout", "Reader", "Spool", "Spooled", "Stretch"]

if not TYPE_CHECKING:
    __getattr__ = later(__name__, {"layout": ("Layout",), "store": ("Reader", "Spool", "Spooled", "Stretch")})
