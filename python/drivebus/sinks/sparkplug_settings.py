"""Where the broker of a Sparkplug host is, and which edge node this is."""

from __future__ import annotations

from dataclasses import dataclass

from drivebus.sinks.mqtt_settings import MqttSettings

__all__ = ["SparkplugSettings"]


@dataclass(frozen=True)
class SparkplugSettings:
    """Where the broker of a Sparkplug host is, and which edge node this is.

    Attributes:
        broker: The broker.
        group: The group of the node.
        node: Its name in the group; no other node of the group has it.
        primary_host: The host without which nothing is told; empty: there is none.
    """

    broker: MqttSettings
    group: str
    node: str
    primary_host: str = ""
