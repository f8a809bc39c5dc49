"""The pins of the component: their names, types and directions, and the way from and to HAL.

HAL's own component is a container by names; anything that behaves like one will do.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, Protocol

__all__ = ["PINS", "Asked", "Container", "Pins"]

PINS: dict[str, tuple[str, str]] = {
    "spindle-on": ("BIT", "IN"),
    "spindle-fwd": ("BIT", "IN"),
    "spindle-rev": ("BIT", "IN"),
    "speed-command": ("FLOAT", "IN"),
    "enable": ("BIT", "IN"),
    "reset": ("BIT", "IN"),
    "speed-feedback": ("FLOAT", "OUT"),
    "speed-feedback-rps": ("FLOAT", "OUT"),
    "frequency-out": ("FLOAT", "OUT"),
    "at-speed": ("BIT", "OUT"),
    "stopped": ("BIT", "OUT"),
    "forward": ("BIT", "OUT"),
    "reverse": ("BIT", "OUT"),
    "brake": ("BIT", "OUT"),
    "fault": ("BIT", "OUT"),
    "fault-code": ("U32", "OUT"),
    "current": ("FLOAT", "OUT"),
    "ready": ("BIT", "OUT"),
    "link-ok": ("BIT", "OUT"),
    "link-quality": ("FLOAT", "OUT"),
    "hours": ("FLOAT", "OUT"),
    "error-count": ("U32", "OUT"),
    "initialized": ("BIT", "OUT"),
}
"""Each pin with HAL's words for its type and its direction."""


class Container(Protocol):
    """What `hal.component` is to this program."""

    def __getitem__(self, name: str, /) -> bool | float: ...
    def __setitem__(self, name: str, value: bool | float, /) -> None: ...


class Asked(NamedTuple):
    """The pins that say what is wanted, at one moment."""

    spindle_on: bool = False
    spindle_fwd: bool = False
    spindle_rev: bool = False
    speed_command: float = 0.0
    enable: bool = False
    reset: bool = False


class Pins:
    """The pins in a *container*."""

    def __init__(self, container: Container) -> None:
        self._container = container

    def asked(self) -> Asked:
        """What is wanted now."""
        at = self._container
        return Asked(
            bool(at["spindle-on"]),
            bool(at["spindle-fwd"]),
            bool(at["spindle-rev"]),
            float(at["speed-command"]),
            bool(at["enable"]),
            bool(at["reset"]),
        )

    def show(self, values: Mapping[str, bool | float]) -> None:
        """Gives each named pin its value."""
        for name, value in values.items():
            self._container[name] = value
