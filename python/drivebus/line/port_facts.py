"""What the system tells of a port that nobody opens."""

from __future__ import annotations

import os
from dataclasses import dataclass

from drivebus import _native, checks

__all__ = ["PortFacts", "facts"]


@dataclass(frozen=True)
class PortFacts:
    """What the system tells of a port without opening it: on Linux, and for ports with a path.

    Attributes:
        driver: The kernel's driver, such as `"ftdi_sio"`, or None.
        adapter: What the adapter says of itself over USB, or None.
        latency_timer_ms: How long the adapter keeps what it receives, in milliseconds; None if that is not known.
        latency_rule: The udev rule that sets that to its least, where it is more; else None.
        holders: Programs that have the port open.
    """

    driver: str | None
    adapter: str | None
    latency_timer_ms: int | None
    latency_rule: str | None
    holders: list[str]


def facts(
    port: str | os.PathLike[str],
    *,
    by_id: str | os.PathLike[str] | None = None,
    tty_class: str | os.PathLike[str] | None = None,
) -> PortFacts:
    """What the system tells of *port*; nothing is opened or sent.

    *by_id* and *tty_class* stand for `/dev/serial/by-id` and `/sys/class/tty`.

    Raises:
        NotAllowed: It is no path.
    """
    return PortFacts(**_native.port_facts(checks.path("port", port), by_id=by_id, tty_class=tty_class))
