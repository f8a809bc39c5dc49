"""From what a person types as a port to what the core opens.

Paths and COM names, `socket://` and `tcp://` go to the core as they are. `sim://` makes a simulator. pyserial's other
URLs are opened by pyserial. What is already open is taken as it is.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qsl

import serial

from drivebus import _native, checks
from drivebus._native import SerialFormat
from drivebus.errors import NotAllowed, PortError
from drivebus.profile import profiles
from drivebus.sim import FAULT_KINDS, Simulator

__all__ = ["PortFacts", "facts", "format_of", "open_simulator", "resolve"]

_CORE_SCHEMES = ("socket", "tcp")
_PYSERIAL_SCHEMES = ("rfc2217", "loop", "spy", "hwgrep", "alt", "cp2110")
_SIMULATOR_OPTIONS = ("clock", "seed", "strict_silence", "echo", "faults")


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


def resolve(port: object, line: SerialFormat) -> Any:
    """What to hand to the core for *port*; a `Simulator` stays one.

    Raises:
        NotAllowed: It is no port at all, or a URL that nobody opens.
        PortError: pyserial could not open it.
    """
    if isinstance(port, Simulator):
        return port
    if isinstance(port, os.PathLike):
        port = os.fspath(port)
    if isinstance(port, str):
        return _resolve_text(port, line)
    if callable(getattr(port, "read", None)) and callable(getattr(port, "write", None)):
        return port
    raise NotAllowed(
        f"port {checks.shown(port)} is no port; give a path (/dev/ttyUSB0, COM3), a URL (socket://host:port, "
        "sim://gd350), a Simulator, or an open serial.Serial"
    )


def format_of(port: object, asked: SerialFormat) -> SerialFormat:
    """The format for *port*: an open serial port and a simulator keep their own, everything else takes *asked*."""
    if isinstance(port, Simulator):
        return port.format
    if isinstance(port, (str, os.PathLike)) or not hasattr(port, "baudrate"):
        return asked
    return SerialFormat(
        getattr(port, "baudrate", asked.baudrate),
        getattr(port, "parity", asked.parity),
        getattr(port, "stopbits", asked.stopbits),
        getattr(port, "bytesize", asked.bytesize),
        asked.silence,
    )


def _resolve_text(port: str, line: SerialFormat) -> Any:
    if not port.strip() or "\0" in port:
        raise NotAllowed(f"port {port!r} is no port; give a path such as /dev/ttyUSB0 or COM3, or a URL")
    try:
        port.encode()
    except UnicodeError:
        raise NotAllowed(f"port {port!r} is not in UTF-8, and no port can be called that") from None
    scheme, separator, _ = port.partition("://")
    if not separator or scheme in _CORE_SCHEMES:
        return port
    if scheme == "sim":
        return open_simulator(port, line)
    if scheme in _PYSERIAL_SCHEMES:
        return _open_pyserial(port, line)
    known = (*_CORE_SCHEMES, "sim", *_PYSERIAL_SCHEMES)
    names = ", ".join(f"{name}://" for name in known)
    raise NotAllowed(f"port {port!r} has an unknown scheme; known are {names}{checks.closest(scheme, known)}")


def _open_pyserial(url: str, line: SerialFormat) -> Any:
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
        raise PortError(f"{url} could not be opened: {error}") from error


def open_simulator(url: str, line: SerialFormat) -> Simulator:
    """`sim://gd350` or `sim://1=gd350,2=gd350`, with `?clock=virtual&seed=1`, as a simulator in this process.

    `faults=0.02` is the share of answers that each kind of fault hits, `late=0.1` that of one kind, `echo=1` an adapter
    that echoes.
    """
    body, _, query = url.removeprefix("sim://").partition("?")
    units: dict[int, str] = {}
    for part in body.strip("/").split(","):
        left, equals, right = part.partition("=")
        unit, family = (left, right) if equals else ("1", left)
        number = checks.digits(unit)
        if number is None:
            raise NotAllowed(f"unit {unit!r} in {url!r} is not a whole number; allowed is 1..247, as in sim://1=gd350")
        if number in units:
            raise NotAllowed(f"unit {unit} stands twice in {url!r}; give each unit once, as in sim://1=gd350,2=gd350")
        units[checks.unit(number)] = checks.one_of("profile", family, profiles())
    options = {"clock": "real", "seed": "0", "strict_silence": "0", "echo": "0"}
    faults: dict[str, float] = {}
    given = parse_qsl(query, keep_blank_values=True)
    for key, value in given:
        checks.one_of("simulator option", key, (*_SIMULATOR_OPTIONS, *FAULT_KINDS))
        if [other for other, _ in given].count(key) > 1:
            raise NotAllowed(f"simulator option {key!r} stands twice in {url!r}; give it once")
        if key == "faults" or key in FAULT_KINDS:
            faults["all" if key == "faults" else key] = _share(key, value, url)
        else:
            options[key] = value
    seed = checks.digits(options["seed"])
    if seed is None:
        raise NotAllowed(f"seed {options['seed']!r} in {url!r} is not a whole number; allowed is 0 or more")
    return Simulator(
        units,
        baudrate=line.baudrate,
        parity=line.parity,
        stopbits=line.stopbits,
        bytesize=line.bytesize,
        silence=line.silence,
        seed=seed,
        transport="process",
        clock=options["clock"],
        strict_silence=_is_on("strict_silence", options["strict_silence"]),
        faults=faults,
        echo=_is_on("echo", options["echo"]),
    )


def _is_on(option: str, text: str) -> bool:
    return checks.one_of(option, text.lower(), ("0", "1", "false", "true")) in ("1", "true")


def _share(kind: str, text: str, url: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise NotAllowed(f"rate {text!r} of {kind} in {url!r} is not a number; allowed is 0..1") from None
