"""What systemd is told of a service: that it is ready, and that it lives. Source: sd_notify(3)."""

from __future__ import annotations

import os
import socket
from contextlib import suppress

__all__ = ["notify", "watchdog_interval"]


def notify(state: str) -> None:
    """Tells *state*, such as `READY=1`, where somebody listens."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address or not hasattr(socket, "AF_UNIX"):
        return
    # An abstract name is written with an @ in front.
    address = f"\0{address[1:]}" if address.startswith("@") else address
    with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as told:
        told.sendto(state.encode(), address)


def watchdog_interval() -> float | None:
    """Seconds between two signs of life, half of what the service manager waits for; None: it waits for none."""
    try:
        waits = int(os.environ["WATCHDOG_USEC"])
        is_meant = int(os.environ.get("WATCHDOG_PID", os.getpid())) == os.getpid()
    except (KeyError, ValueError):
        return None
    return waits / 2_000_000 if is_meant and waits > 0 else None
