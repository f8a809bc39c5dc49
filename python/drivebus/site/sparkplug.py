"""Which edge node of Sparkplug B a site is, and at which broker, as `drivebus serve` does it.

    [sparkplug]
    host = "broker.plant.example"
    username = "hall-1"
    password_file = "/etc/drivebus/mqtt-password"
    group = "plant"
    node = "hall-1"
    primary_host = "scada"

Here it is read.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivebus.site.broker import BROKER_KEYS, SiteBroker, broker_of, that
from drivebus.site.reading import Reading

__all__ = ["SiteSparkplug", "sparkplug_of"]


@dataclass(frozen=True)
class SiteSparkplug:
    """An edge node.

    Attributes:
        broker: Where its broker is.
        group: The group of the node.
        node: Its name in the group.
        primary_host: The host without which nothing is told; empty: there is none.
        at: In which line of the file its table begins.
    """

    broker: SiteBroker
    group: str
    node: str
    primary_host: str = ""
    at: int = 1


def sparkplug_of(file: Reading) -> SiteSparkplug | None:
    """What *file* says of Sparkplug; what is wrong in it is complained of."""
    table = file.section("sparkplug", (*BROKER_KEYS, "group", "node", "primary_host"))
    if table is None:
        return None
    # Not for who has no such table: a stop waits for all that is loaded.
    from drivebus.sinks.mqtt_topics import why_no_level

    where = ("sparkplug",)
    broker = broker_of(file, table, "sparkplug")
    group = file.value(where, table, "group", that(why_no_level), needed=True)
    node = file.value(where, table, "node", that(why_no_level), needed=True)
    host = file.value(where, table, "primary_host", that(why_no_level)) or ""
    if broker is None or group is None or node is None:
        return None
    return SiteSparkplug(broker, group, node, host, file.line_of(where))
