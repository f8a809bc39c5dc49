"""What a drive is set to: kept in a file, compared, and given back.

`Backup` is what was read of one drive, `Diff` how two of them differ, `Restoration` what became of each parameter that
was to be given back. `Drive.backup`, `Drive.diff` and `Drive.restore` make them.
"""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.backup.compare import Diff, Difference
    from drivebus.backup.model import Backup, Origin
    from drivebus.backup.results import Restoration, Restored
    from drivebus.backup.unread import Unread

__all__ = ["Backup", "Diff", "Difference", "Origin", "Restoration", "Restored", "Unread"]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "compare": ("Diff", "Difference"),
            "model": ("Backup", "Origin"),
            "results": ("Restoration", "Restored"),
            "unread": ("Unread",),
        },
    )
