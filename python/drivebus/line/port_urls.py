"""From what a person types as a port to what the core opens.

The core knows the grammar of ports. Paths and COM names, `socket://` and `tcp://` it opens itself. `sim://` makes a
simulator. pyserial's other URLs are opened by pyserial. What is already open is taken as it is.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from errno import EIO
from typing import TYPE_CHECKING, Any

from drivebus import _native, checks
from drivebus._native import SerialFormat
from drivebus.errors import BadArgument, PortError
from drivebus.profile import profiles

if TYPE_CHECKING:
    from drivebus.sim import Simulator

__all__ = ["as_simulator", "format_of", "resolve"]

_PYSERIAL_SCHEMES = ("rfc2217", "loop", "spy", "hwgrep", "alt", "cp2110")


def resolve(port: object, line: SerialFormat) -> Any:
    """What to hand to the core for *port*; a `Simulator` stays one.

    Raises:
        NotAllowed: It is no port at all, or a URL that nobody opens.
        PortError: pyserial could not open it.
    """
    if isinstance(port, os.PathLike):
        port = os.fspath(port)
    if isinstance(port, str):
        return _resolve_text(port, line)
    if as_simulator(port) is not None:
        return port
    if callable(getattr(port, "read", None)) and callable(getattr(port, "write", None)):
        return port
    raise BadArgument(
        f"{checks.shown(port)} is not a port; give a path (/dev/ttyUSB0, COM3), a URL (socket://host:port, "
        "sim://gd350), a Simulator, or an open serial.Serial"
    )


def format_of(port: object, asked: SerialFormat) -> SerialFormat:
    """The format for *port*: an open serial port and a simulator keep their own, everything else takes *asked*."""
    if isinstance(port, (str, os.PathLike)):
        return asked
    if (simulator := as_simulator(port)) is not None:
        return simulator.format
    if not hasattr(port, "baudrate"):
        return asked
    return SerialFormat(
        getattr(port, "baudrate", asked.baudrate),
        getattr(port, "parity", asked.parity),
        getattr(port, "stopbits", asked.stopbits),
        getattr(port, "bytesize", asked.bytesize),
        asked.silence,
    )


def as_simulator(port: object) -> Simulator | None:
    """*port*, where it is a simulator. One that is text never is: what a simulator needs is not loaded for it."""
    if isinstance(port, str):
        return None
    from drivebus.sim import Simulator

    return port if isinstance(port, Simulator) else None


def _resolve_text(port: str, line: SerialFormat) -> Any:
    try:
        port.encode()
    except UnicodeError:
        raise BadArgument(f"port {checks.shown(port)} is not in UTF-8, and no port can be called that") from None
    scheme, simulator = _native.port_url(
        port, schemes=_PYSERIAL_SCHEMES, families=profiles(), faults=_native.fault_kinds()
    )
    if scheme == "sim":
        return _simulator(simulator, line)
    return _open_pyserial(port, line) if scheme in _PYSERIAL_SCHEMES else port


def _open_pyserial(url: str, line: SerialFormat) -> Any:
    import serial

    try:
        return serial.serial_for_url(
            url,
            baudrate=line.baudrate,
            parity=line.parity,
            stopbits=line.stopbits,
            bytesize=line.bytesize,
            timeout=0,
        )
    except Exception as error:
        # What somebody's module for a scheme makes of a URL that it does not understand, it says in its own way.
        number = error.errno if isinstance(error, OSError) else None
        raise PortError(f"{url} could not be opened: {error}", errno=number or EIO) from error


def _simulator(arguments: Mapping[str, Any], line: SerialFormat) -> Simulator:
    """The simulator that a URL asks for, in this process."""
    from drivebus.sim import Simulator

    return Simulator(
        **arguments,
        baudrate=line.baudrate,
        parity=line.parity,
        stopbits=line.stopbits,
        bytesize=line.bytesize,
        silence=line.silence,
        transport="process",
    )
