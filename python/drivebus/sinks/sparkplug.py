"""Samples and events of a spool as an edge node of Sparkplug B, with drives as its devices."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

from drivebus.sinks.delivery import Delivery
from drivebus.sinks.needs_paho import module_for
from drivebus.sinks.picture import Picture
from drivebus.sinks.sparkplug_settings import SparkplugSettings
from drivebus.spool import Spool

__all__ = ["Sparkplug"]


class Sparkplug:
    """Tells hosts of Sparkplug how a plant is and was, until it is closed.

    Whatever goes wrong at the broker is told once and tried again, for ever.

    Args:
        spool: Where samples and events wait.
        settings: Where to.
        look: Gives how the plant is now. Any thread.
        tell: Hears in words what people should know.

    Raises:
        NotAllowed: The settings cannot be, or paho-mqtt is not installed. Nothing was connected.
    """

    def __init__(
        self, spool: Spool, settings: SparkplugSettings, look: Callable[[], Picture], tell: Callable[[str], None]
    ) -> None:
        self.check(settings)
        self._delivery = Delivery(spool, "sparkplug", _module("sparkplug_session").Session(spool, settings, look), tell)

    @staticmethod
    def check(settings: SparkplugSettings) -> None:
        """Whether *settings* can be. Nothing is connected.

        Raises:
            NotAllowed: They cannot, or paho-mqtt is not installed.
        """
        _module("mqtt_client").checked(settings.broker)

    def start(self) -> None:
        """Begins to deliver, in a thread of its own."""
        self._delivery.start()

    def close(self) -> None:
        """Ends within a second; what no host has stays in the spool. Closing again does nothing."""
        self._delivery.close()

    def status(self) -> dict[str, Any]:
        """How it does: `connected`, `why` it is not, `behind`: samples not told yet, and `delivered` since it began."""
        return self._delivery.status()


def _module(name: str) -> ModuleType:
    """The module called *name*, which needs paho-mqtt."""
    return module_for("Sparkplug", name)
