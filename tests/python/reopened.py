"""Reads of a port that was away, on a machine that may be busy."""

from __future__ import annotations

from drivebus import Bus, PortError

__all__ = ["read_once_open"]


def read_once_open(bus: Bus, register: int) -> list[int]:
    """What unit 1 has in *register*, once the port is open: on a busy machine a call may be told that it is not yet."""
    while True:
        try:
            return bus.read(1, register)
        except PortError as error:
            if "is still being opened" not in str(error):
                raise
