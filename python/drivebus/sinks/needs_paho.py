"""Modules that need paho-mqtt, which not everybody has installed."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from drivebus.errors import NotAllowed

__all__ = ["module_for"]


def module_for(what: str, name: str) -> ModuleType:
    """The module of the sinks called *name*, for *what* they are for.

    Raises:
        NotAllowed: paho-mqtt is not installed.
    """
    try:
        return import_module(f"drivebus.sinks.{name}")
    except ImportError:
        raise NotAllowed(f"{what} needs paho-mqtt: pip install 'drivebus[mqtt]'") from None
