"""Which parameters a drive has, asked of the drive itself: by reads alone, into a profile that people go on with."""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.discovery.found import Discovery

__all__ = ["Discovery"]

if not TYPE_CHECKING:
    __getattr__ = later(__name__, {"found": ("Discovery",)})
