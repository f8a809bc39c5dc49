"""One adapter for each library: how its own documentation opens a port, reads and writes, and nothing more.

No result is changed: what a call returns is handed on, what it raises is left to rise. Only where a library returns
its error instead of raising it does the adapter raise `ErrorReturned` with that object's name.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from collections.abc import Sequence

UNIT = 1


class ErrorReturned(Exception):
    """The call returned an object that says it is an error."""


class Adapter(ABC):
    """A library's master on one port, 8N1, for unit 1.

    Args:
        port: The path of the port.
        baudrate: Bits per second.
        timeout: Seconds, the same for every library.
        retries: None for the library's own default, 0 for none.
    """

    #: What pip calls it.
    distribution: str
    #: What is set beside port, speed, parity and time-out, and what is not the library's default.
    settings: str

    @abstractmethod
    def __init__(self, port: str, baudrate: int, timeout: float, retries: int | None) -> None: ...

    @abstractmethod
    def read(self, address: int, count: int) -> Sequence[int]:
        """Holding registers (03H)."""

    @abstractmethod
    def write(self, address: int, value: int) -> Sequence[int] | None:
        """One register (06H). Returns what the call says was written: address and value, only the value, or nothing."""

    @abstractmethod
    def broadcast(self, address: int, value: int) -> None:
        """One register of every unit (06H to address 0)."""

    @abstractmethod
    def close(self) -> None: ...


NAMES = ("drivebus", "pymodbus", "minimalmodbus", "modbus_tk", "umodbus", "tmodbus")


def adapter(name: str) -> type[Adapter]:
    """The adapter of *name*. ImportError where the library is not installed."""
    found: object = importlib.import_module(f"{__name__}.with_{name}").Master
    assert isinstance(found, type)
    assert issubclass(found, Adapter)
    return found
