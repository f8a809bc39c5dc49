"""Where a broker is, and who speaks to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivebus.sinks.mqtt_topics import Topics

__all__ = ["MqttSettings"]


@dataclass(frozen=True)
class MqttSettings:
    """Where a broker is, and who speaks to it.

    Attributes:
        host: The computer of the broker.
        port: Where it listens.
        gateway: The name of this gateway: one level of a topic, and no other gateway at this broker has it.
        tls: Whether the way there is encrypted, and the broker's certificate verified.
        prefix: What its topics begin with.
        username: Who it is for the broker; empty: nobody.
        password_file: A file with the password, which others may not read.
        ca_file: The certificates that are trusted; None: those that the system trusts.
        home_assistant: What the topics of Home Assistant's discovery begin with; empty: it is told nothing.
        beat: Seconds between two signs of life that the broker is asked for while somebody depends on it.
    """

    host: str
    port: int
    gateway: str
    tls: bool = True
    prefix: str = "drivebus"
    username: str = ""
    password_file: Path | None = None
    ca_file: Path | None = None
    home_assistant: str = ""
    beat: float = 1.0

    @property
    def topics(self) -> Topics:
        """Where everything is told."""
        return Topics(self.prefix, self.gateway)
