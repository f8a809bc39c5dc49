"""The families that units were once surely known to be, kept in a file of the user's between programs.

Whoever has to stop a motor over a bad line need not ask the drive first what it is. A line is told by its adapter where
that has a name of its own, else by the name of its port. What is kept is a hint: a different drive there is still
noticed before anything else is written.

The file has a line for each unit: its family, a tab, and what tells it from others. A stop reads it before it sends
anything, so nothing large is loaded for that: `os.path` is there already, and `pathlib` is not.
"""

from __future__ import annotations

import os
from contextlib import suppress

from drivebus.line.addresses import Addresses
from drivebus.site.state_folder import state_file

__all__ = ["families_on", "forget", "known_family", "remember"]

_MOST = 1000
"""Units that are kept; then those that were known longest give way."""
_LONGEST = 1000
"""Characters of a line; nothing that was kept here has as many."""
_DIGITS = 3
"""Of an address."""


def known_family(port: str, unit: int) -> str | None:
    """The family that *unit* on *port* was when it was surely known last, or None."""
    key = _key(port, unit)
    return None if key is None else _read().get(key)


def families_on(port: str) -> dict[int, str]:
    """The families of the units on *port* that were surely known last; reserved ones were asked by name then.

    Not of 0, which may be all units behind a gateway.
    """
    key = _key(port, 0)
    if key is None:
        return {}
    line = key.removesuffix("0")
    kept = {place.removeprefix(line): family for place, family in _read().items() if place.startswith(line)}
    known = {unit: family for unit, family in kept.items() if unit.isdecimal() and len(unit) <= _DIGITS}
    allowed = Addresses.of(port, reserved=True)
    return {int(unit): family for unit, family in known.items() if int(unit) and not allowed.why_not(int(unit))}


def remember(port: str, unit: int, family: str) -> None:
    """Keeps that *unit* on *port* is surely of *family*. What cannot be kept is not: it is only a hint."""
    key, known = _key(port, unit), _read()
    if key is not None and known.get(key) != family:
        known.pop(key, None)
        _write({**known, key: family})


def forget(port: str, unit: int) -> None:
    """Forgets what *unit* on *port* is."""
    key, known = _key(port, unit), _read()
    if key is not None and known.pop(key, None) is not None:
        _write(known)


def _key(port: str, unit: int) -> str | None:
    """What tells the unit from others; None where the line is nothing that stays, such as a simulation."""
    scheme, separator, _ = port.partition("://")
    if separator:
        return f"{port.lower()} unit {unit}" if scheme.lower() in ("socket", "tcp") else None
    name = real = os.path.realpath(port)
    links = os.environ.get("DRIVEBUS_SERIAL_BY_ID") or "/dev/serial/by-id"
    with suppress(OSError):
        name = next((link for link in os.listdir(links) if os.path.realpath(f"{links}/{link}") == real), real)
    # What would end the line in the file is no name of a port.
    return f"{name} unit {unit}" if name.isprintable() else None


def _read() -> dict[str, str]:
    """What is kept; nothing where the file is not there, or is anything else."""
    try:
        with open(state_file("families"), encoding="utf-8") as file:
            parts = [
                line.rstrip("\n").partition("\t") for line in file.read(_MOST * _LONGEST).splitlines(keepends=True)
            ]
    except (OSError, ValueError):
        return {}
    return {key: family for family, tab, key in parts if tab and family and key and len(key) < _LONGEST}


def _write(known: dict[str, str]) -> None:
    # A user without a home, a full disk, a folder that may not be written to: nothing is remembered then.
    with suppress(OSError):
        place = state_file("families")
        os.makedirs(os.path.dirname(place), mode=0o700, exist_ok=True)
        new = f"{place}.{os.getpid()}"
        try:
            with open(new, "w", encoding="utf-8") as file:
                file.writelines(f"{family}\t{key}\n" for key, family in list(known.items())[-_MOST:])
            os.replace(new, place)
        finally:
            with suppress(OSError):
                os.remove(new)
