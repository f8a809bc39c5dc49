"""What a service gives its outlets: a plant as they see it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drivebus.service.events import Events
from drivebus.service.orders import Orders
from drivebus.sinks import Picture
from drivebus.site import Site
from drivebus.spool import Spool

__all__ = ["Plant"]


@dataclass(frozen=True)
class Plant:
    """A plant, as outlets see it.

    Attributes:
        site: What its file says.
        look: Gives how it is now. Any thread.
        spool: Where samples and events wait, if they do.
        events: What happened.
        orders: What drives can be told.
        tell: Hears in words what people should know.
    """

    site: Site
    look: Callable[[], Picture]
    spool: Spool | None
    events: Events
    orders: Orders
    tell: Callable[[str], None]
