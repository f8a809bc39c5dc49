"""Which broker a site speaks to by MQTT, and what it may be told there, as `drivebus serve` does it.

    [mqtt]
    host = "broker.plant.example"
    username = "hall-1"
    password_file = "/etc/drivebus/mqtt-password"
    gateway = "hall-1"
    home_assistant = "homeassistant"
    dead_man = 5.0

    [[mqtt.allow]]
    drives = ["pumps"]
    commands = ["run", "setpoint", "reset"]

Here it is read. What the families of the drives can be told, they know.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from drivebus.site.broker import BROKER_KEYS, SiteBroker, broker_of, that
from drivebus.site.entries import SiteDrive, drives_named
from drivebus.site.reading import Key, Reading, dead_man_of, listed, one_of, text

__all__ = ["SiteMqtt", "SiteMqttAllow", "mqtt_of"]

_DEAD_MAN = (1.0, 3600.0)
"""Seconds."""
_KEYS = (*BROKER_KEYS, "gateway", "topic", "home_assistant", "dead_man", "allow")


@dataclass(frozen=True)
class SiteMqttAllow:
    """What some drives may be told.

    Attributes:
        drives: The drives.
        commands: Of `order_words.MOVES`. Who may do any of it may stop, too.
        lines: In which line of the file each key stands, and the table itself by an empty name.
    """

    drives: tuple[SiteDrive, ...]
    commands: tuple[str, ...]
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SiteMqtt:
    """The broker.

    Attributes:
        broker: Where it is, and who this is for it.
        gateway: The name of this gateway in the topics.
        topic: What the topics begin with.
        home_assistant: What topics of Home Assistant's discovery begin with; empty: it is told nothing.
        dead_man: Seconds without the broker after which a motor is halted, `"off"`, or None where it is not said.
        allow: What drives may be told.
        at: In which line of the file its table begins.
    """

    broker: SiteBroker
    gateway: str
    topic: str = "drivebus"
    home_assistant: str = ""
    dead_man: float | Literal["off"] | None = None
    allow: tuple[SiteMqttAllow, ...] = ()
    at: int = 1

    @property
    def may(self) -> dict[str, frozenset[str]]:
        """What each drive may be told, by its name."""
        found: dict[str, frozenset[str]] = {}
        for rule in self.allow:
            for drive in rule.drives:
                found[drive.name] = found.get(drive.name, frozenset()) | frozenset(rule.commands)
        return {name: may for name, may in found.items() if may}


def mqtt_of(
    file: Reading, drives: Mapping[str, SiteDrive], groups: Mapping[str, tuple[SiteDrive, ...]]
) -> SiteMqtt | None:
    """What *file* says of MQTT; what is wrong in it is complained of."""
    table = file.section("mqtt", _KEYS)
    if table is None:
        return None
    # Not for who has no such table: a stop waits for all that is loaded.
    from drivebus.sinks.mqtt_topics import why_no_level, why_no_prefix

    where = ("mqtt",)
    broker = broker_of(file, table, "mqtt")
    gateway = file.value(where, table, "gateway", that(why_no_level), needed=True)
    topic = file.value(where, table, "topic", that(why_no_prefix)) or "drivebus"
    discovery = file.value(where, table, "home_assistant", that(why_no_prefix)) or ""
    dead_man = file.value(where, table, "dead_man", dead_man_of(*_DEAD_MAN))
    allow = [_allow(file, each, there, drives, groups) for there, each in file.tables(table, (*where, "allow"))]
    if broker is None or gateway is None:
        return None
    return SiteMqtt(broker, gateway, topic, discovery, dead_man, tuple(allow), file.line_of(where))


def _allow(
    file: Reading,
    table: dict[str, Any],
    where: Key,
    drives: Mapping[str, SiteDrive],
    groups: Mapping[str, tuple[SiteDrive, ...]],
) -> SiteMqttAllow:
    from drivebus.sinks.order_words import MOVES

    keys = ("drives", "commands")
    file.check_keys(table, keys, where)
    names = file.value(where, table, "drives", listed(text, '["pump1"]'), needed=True) or []
    commands = file.value(where, table, "commands", listed(one_of(*MOVES), '["run"]'), needed=True) or []
    chosen = drives_named(names, drives, groups, file, (*where, "drives"))
    at = {key: file.line_of((*where, key)) for key in keys if key in table} | {"": file.line_of(where)}
    return SiteMqttAllow(chosen, tuple(commands), at)
