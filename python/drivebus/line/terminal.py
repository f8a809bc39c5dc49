"""The settings of a port that a Python object owns and that is a terminal of this system: read back, and set again.

Beside `crates/line/src/ports/tty/settings.rs`, which does the same for ports that are opened by their names.
"""

from __future__ import annotations

import sys
from typing import Any

if sys.platform == "win32":
    # Nothing below is called there: `settings` has none.
    termios: Any = None
else:
    import termios

__all__ = ["differences", "own", "set_again", "settings"]

_FLAGS = (
    (0, ("IGNBRK", "BRKINT", "IGNPAR", "PARMRK", "INPCK", "ISTRIP", "INLCR", "IGNCR", "ICRNL", "IXON", "IXOFF")),
    (1, ("OPOST",)),
    (2, ("CREAD", "CLOCAL", "CRTSCTS")),
    (3, ("ISIG", "ICANON", "ECHO", "ECHONL", "IEXTEN")),
)
"""What makes a difference to the bytes that come and go, by its place in what `termios.tcgetattr` returns."""
_CMSPAR = 0o10000000000
"""A parity bit that never changes: Linux, which Python has no name for."""


def settings(port: Any) -> list[Any] | None:
    """What the terminal behind *port* is set to; None where there is none, or nobody tells."""
    if sys.platform == "win32":
        return None
    try:
        return termios.tcgetattr(port.fileno())
    except (AttributeError, OSError, ValueError, TypeError, termios.error):
        return None


def own(port: Any) -> tuple[object, ...]:
    """What *port* says that it is set to: who owns it may change that, and means it."""
    return tuple(
        getattr(port, name, None) for name in ("baudrate", "bytesize", "parity", "stopbits", "rtscts", "xonxoff")
    )


def set_again(port: Any, opened: list[Any]) -> tuple[list[str], list[str]]:
    """Sets *port* to *opened* where it is not any more: what it had otherwise, in words, and what is still so."""
    found = settings(port)
    changed = [] if found is None else differences(opened, found)
    if not changed:
        return [], []
    try:
        termios.tcsetattr(port.fileno(), termios.TCSANOW, opened)
        if opened[5] not in _speeds() and hasattr(port, "baudrate"):
            # A speed without a name goes another way, which the object knows.
            port.baudrate = port.baudrate
    except (OSError, ValueError, termios.error):
        pass  # What it has taken of it, is read back.
    found = settings(port)
    return changed, changed if found is None else differences(opened, found)


def differences(opened: list[Any], found: list[Any]) -> list[str]:
    """What *found* has otherwise than *opened*, in words."""
    told = []
    speeds = _speeds()
    # A driver that is told one speed keeps the other as it was; few have two.
    for place, what in ((5, ""), (4, "receives at ")):
        then, now = [speeds.get(these[place], "another number of") for these in (opened, found)]
        if opened[place] != found[place]:
            told.append(f"{what}{now} bit/s instead of {then}")
            break
    for words in (_parity, _data_bits, _stop_bits):
        before, after = words(opened[2]), words(found[2])
        if before != after:
            told.append(f"{'parity ' if words is _parity else ''}{after} instead of {before}")
    for place, names in _FLAGS:
        for name in names:
            flag = getattr(termios, name, 0)
            if (opened[place] ^ found[place]) & flag:
                told.append(f"{name} {'on' if found[place] & flag else 'off'}")
    for name, place in (("VMIN", termios.VMIN), ("VTIME", termios.VTIME)):
        least, now_least = _code(opened[6][place]), _code(found[6][place])
        if least != now_least:
            told.append(f"{name} {now_least} instead of {least}")
    return told


def _speeds() -> dict[int, int]:
    """How many bits a second are meant by each number that the system has for it."""
    return {value: int(name[1:]) for name, value in vars(termios).items() if name[:1] == "B" and name[1:].isdecimal()}


def _parity(modes: int) -> str:
    if not modes & termios.PARENB:
        return "none"
    if modes & _CMSPAR:
        return "that never changes"
    return "odd" if modes & termios.PARODD else "even"


def _data_bits(modes: int) -> str:
    sizes = {termios.CS5: 5, termios.CS6: 6, termios.CS7: 7, termios.CS8: 8}
    return f"{sizes[modes & termios.CSIZE]} data bits"


def _stop_bits(modes: int) -> str:
    return "2 stop bits" if modes & termios.CSTOPB else "1 stop bit"


def _code(value: bytes | int) -> int:
    """Python has VMIN and VTIME as numbers only where lines are not edited."""
    return value if isinstance(value, int) else value[0]
