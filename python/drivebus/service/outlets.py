"""What a service tells others: each outlet that its file asks for, begun and ended with it.

None of them can hold a line up, and what goes wrong in one is told, and tried again.
"""

from __future__ import annotations

from typing import Any, Protocol

from drivebus.service.listening import Listening
from drivebus.service.mistakes import settings_of, sparkplug_settings_of
from drivebus.service.over_mqtt import OverMqtt
from drivebus.service.plant import Plant
from drivebus.sinks import Postgres, Prometheus, Sparkplug

__all__ = ["Outlet", "outlets_of"]


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
        found["mqtt"] = OverMqtt(plant, site.mqtt)
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

        found["web"] = Page(plant, site.web)
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
