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

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from drivebus.site.entries import SiteDrive, drives_named
from drivebus.site.reading import Key, Reading, Wrong, dead_man_of, flag, listed, one_of, text, whole

__all__ = ["COMMANDS", "SiteMqtt", "SiteMqttAllow", "mqtt_of"]

COMMANDS = ("run", "setpoint", "reset")
"""What may be allowed. Who may do any of it may stop, too."""
_PLAIN, _ENCRYPTED = 1883, 8883
_DEAD_MAN = (1.0, 3600.0)
"""Seconds."""
_KEYS = (
    "host",
    "port",
    "gateway",
    "username",
    "password_file",
    "ca_file",
    "tls",
    "topic",
    "home_assistant",
    "dead_man",
    "allow",
)


@dataclass(frozen=True)
class SiteMqttAllow:
    """What some drives may be told.

    Attributes:
        drives: The drives.
        commands: Of `COMMANDS`.
        lines: In which line of the file each key stands, and the table itself by an empty name.
    """

    drives: tuple[SiteDrive, ...]
    commands: tuple[str, ...]
    lines: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class SiteMqtt:
    """The broker.

    Attributes:
        host: Its computer.
        port: Where it listens there.
        gateway: The name of this gateway in the topics.
        tls: Whether the way there is encrypted.
        topic: What the topics begin with.
        username: Who this is for it; empty: nobody.
        password_file: A file with the password.
        ca_file: The certificates that are trusted; None: those of the system.
        home_assistant: What topics of Home Assistant's discovery begin with; empty: it is told nothing.
        dead_man: Seconds without the broker after which a motor is halted, `"off"`, or None where it is not said.
        allow: What drives may be told.
        at: In which line of the file its table begins.
    """

    host: str
    port: int
    gateway: str
    tls: bool = True
    topic: str = "drivebus"
    username: str = ""
    password_file: Path | None = None
    ca_file: Path | None = None
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
    from drivebus.sinks.this_computer import is_loopback

    where = ("mqtt",)
    host = file.value(where, table, "host", text, needed=True)
    gateway = file.value(where, table, "gateway", _that(why_no_level), needed=True)
    tls = file.value(where, table, "tls", flag)
    if tls is None:
        tls = host is None or not is_loopback(host)
    port = file.value(where, table, "port", whole(1, 0xFFFF)) or (_ENCRYPTED if tls else _PLAIN)
    topic = file.value(where, table, "topic", _that(why_no_prefix)) or "drivebus"
    discovery = file.value(where, table, "home_assistant", _that(why_no_prefix)) or ""
    username = file.value(where, table, "username", text) or ""
    password, ca = (_file(file, table, key) for key in ("password_file", "ca_file"))
    dead_man = file.value(where, table, "dead_man", dead_man_of(*_DEAD_MAN))
    allow = [_allow(file, each, there, drives, groups) for there, each in file.tables(table, (*where, "allow"))]
    if password is not None and not username:
        file.complain((*where, "password_file"), "a password is one of somebody: say username")
    if ca is not None and not tls:
        file.complain((*where, "ca_file"), "certificates are for a way that is encrypted: say tls = true")
    if "spool" not in file.data:
        file.complain(where, "samples wait in a spool until the broker has them: say [spool]")
    if host is None or gateway is None:
        return None
    at = file.line_of(where)
    return SiteMqtt(host, port, gateway, tls, topic, username, password, ca, discovery, dead_man, tuple(allow), at)


def _allow(
    file: Reading,
    table: dict[str, Any],
    where: Key,
    drives: Mapping[str, SiteDrive],
    groups: Mapping[str, tuple[SiteDrive, ...]],
) -> SiteMqttAllow:
    keys = ("drives", "commands")
    file.check_keys(table, keys, where)
    names = file.value(where, table, "drives", listed(text, '["pump1"]'), needed=True) or []
    commands = file.value(where, table, "commands", listed(one_of(*COMMANDS), '["run"]'), needed=True) or []
    chosen = drives_named(names, drives, groups, file, (*where, "drives"))
    at = {key: file.line_of((*where, key)) for key in keys if key in table} | {"": file.line_of(where)}
    return SiteMqttAllow(chosen, tuple(commands), at)


def _file(file: Reading, table: dict[str, Any], key: str) -> Path | None:
    given = file.value(("mqtt",), table, key, text)
    return None if given is None else file.path.parent / given


def _that(why_not: Callable[[str], str]) -> Callable[[Any], str]:
    """A text, if there is nothing that *why_not* says against it."""

    def read(value: Any) -> str:
        if why := why_not(text(value)):
            raise Wrong(why)
        return text(value)

    return read
