"""What a service tells others: each outlet that its file asks for, begun and ended with it.

None of them can hold a line up, and what goes wrong in one is told, and tried again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from drivebus.service.events import Events
from drivebus.service.listening import Listening
from drivebus.service.mistakes import settings_of, sparkplug_settings_of
from drivebus.service.orders import Orders
from drivebus.service.over_mqtt import OverMqtt
from drivebus.sinks import Picture, Postgres, Prometheus, Sparkplug
from drivebus.site import Site
from drivebus.spool import Spool

__all__ = ["Outlet", "Plant", "outlets_of"]


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


class Outlet(Protocol):
    """Something that is told how the plant is."""

    def start(self) -> None:
        """Begins; returns at once."""

    def turn(self) -> None:
        """Comes once a second."""

    def close(self) -> None:
        """Ends within a second."""

    def status(self) -> dict[str, Any]:
        """How it does, in plain words and numbers."""


def outlets_of(plant: Plant) -> dict[str, Outlet]:
    """Those that the file of *plant* asks for, by their sections."""
    site, found = plant.site, dict[str, Outlet]()
    if site.postgres is not None and plant.spool is not None:
        found["postgres"] = _Delivering(Postgres(plant.spool, settings_of(site.postgres), plant.tell))
    if site.mqtt is not None:
        found["mqtt"] = OverMqtt(site, site.mqtt, plant.look, plant.spool, plant.events, plant.orders, plant.tell)
    if site.sparkplug is not None and plant.spool is not None:
        node = Sparkplug(plant.spool, sparkplug_settings_of(site.sparkplug), plant.look, plant.tell)
        found["sparkplug"] = _Delivering(node)
    if site.prometheus is not None:
        address = site.prometheus.address
        found["prometheus"] = Listening(
            "prometheus",
            f"metrics are at http://{address}/metrics",
            lambda: Prometheus(address, plant.look),
            plant.tell,
        )
    if site.web is not None:
        # Not for who has none: what it is made of takes time to load.
        from drivebus.service.page import Page

        found["web"] = Page(site, site.web, plant.look, plant.spool, plant.events, plant.orders, plant.tell)
    return found


class _Delivers(Protocol):
    def start(self) -> None: ...
    def close(self) -> None: ...
    def status(self) -> dict[str, Any]: ...


class _Delivering:
    """A sink with a thread of its own."""

    def __init__(self, sink: _Delivers) -> None:
        self.start, self.close, self.status = sink.start, sink.close, sink.status

    def turn(self) -> None:
        """Its own thread does all."""
