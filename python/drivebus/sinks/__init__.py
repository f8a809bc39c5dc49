"""Where samples go: programs of others, each at a pace of its own. None of them can hold a line up."""

from typing import TYPE_CHECKING

from drivebus.lazy_names import later

if TYPE_CHECKING:
    from drivebus.sinks.picture import DrivePicture, GatewayPicture, LinePicture, Picture
    from drivebus.sinks.prometheus import Prometheus

__all__ = ["DrivePicture", "GatewayPicture", "LinePicture", "Picture", "Prometheus"]

if not TYPE_CHECKING:
    __getattr__ = later(
        __name__,
        {
            "picture": ("DrivePicture", "GatewayPicture", "LinePicture", "Picture"),
            "prometheus": ("Prometheus",),
        },
    )
