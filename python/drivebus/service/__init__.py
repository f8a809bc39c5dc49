"""The lines of a site, served: to the programs of a computer, and to clients over the network, as its file says."""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.service.mistakes import check, hours_of
    from drivebus.service.serving import Service
    from drivebus.service.status import read_status

__all__ = ["Service", "check", "hours_of", "read_status"]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__, {"mistakes": ("check", "hours_of"), "serving": ("Service",), "status": ("read_status",)}
    )
