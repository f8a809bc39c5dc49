"""What is asked of LinuxCNC itself: its Python module, a component with our pins, and whether it still lives."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

from drivebus.errors import NotAllowed
from drivebus.hal.pins import PINS

__all__ = ["Alive", "HalGone", "component", "module"]

USUAL = "/usr/lib/python3/dist-packages"
"""Where Debian's package puts the module, which a virtual environment does not look into."""

_KEY = 0x48414C32
"""The key of HAL's shared memory, in `src/hal/hal_priv.h` of LinuxCNC."""

_REALTIME = "rtapi_app"
"""The program that holds the real-time side of HAL, without which no thread changes a pin."""

_LOOK_EVERY = 0.25
_SEARCH_EVERY = 2.0
_ALONE = 2.0
"""Seconds alone on HAL's memory, with the motor turning, after which nobody is taken to come back."""


class HalGone(Exception):
    """HAL has gone, and nobody is left who could change a pin."""


def module(folder: str | None = None) -> Any:
    """LinuxCNC's module `hal`, from *folder* if that is given, else from where Python and Debian have it.

    Raises:
        NotAllowed: It is not there, or made for another Python.
    """
    places = [folder] if folder is not None else [USUAL]
    before = list(sys.path)
    sys.path[:] = [*places, *before] if folder is not None else [*before, *places]
    try:
        return importlib.import_module("hal")
    except ImportError as error:
        raise NotAllowed(_missing(error, places)) from error
    finally:
        # What else Debian has there is for Debian's own Python.
        sys.path[:] = before


def _missing(error: ImportError, places: list[str]) -> str:
    here = f"{sys.version_info.major}.{sys.version_info.minor}"
    for place in places:
        made = sorted(Path(place).glob("_hal.cpython-*.so"))
        if made and f"-{here.replace('.', '')}-" not in made[0].name:
            return (
                f"LinuxCNC's Python module there is {made[0].name}, and this is Python {here}: install drivebus for "
                "the Python that LinuxCNC uses (`/usr/bin/python3 -m venv …`)"
            )
    return (
        f"LinuxCNC's Python module `hal` cannot be used ({error}): install LinuxCNC (Debian: `apt-get install "
        "linuxcnc-uspace`), or say with --hal-path in which folder hal.py is"
    )


def component(hal: Any, name: str) -> Any:
    """A component of HAL called *name*, with our pins, which is not ready yet.

    Raises:
        NotAllowed: HAL does not take it, as where one of this name is there already.
    """
    try:
        made = hal.component(name)
        for pin, (kind, direction) in PINS.items():
            made.newpin(pin, getattr(hal, f"HAL_{kind}"), getattr(hal, f"HAL_{direction}"))
    except (hal.error, OSError, ValueError, RuntimeError) as error:
        raise NotAllowed(f"HAL does not take a component {name}: {error}; is one of this name loaded?") from error
    return made


class Alive:
    """Whether HAL still lives, as the system tells.

    Args:
        proc: Where the system tells.
    """

    def __init__(self, proc: Path = Path("/proc")) -> None:
        self._proc = proc
        self._realtime: set[int] = set()
        self._had_memory = False
        self._next = self._next_search = 0.0
        self._alone_since: float | None = None

    def gone(self, now: float, *, turning: bool) -> str:
        """Why HAL counts as gone, at *now* on any clock; empty while it lives. *turning*: whether a motor does."""
        if now < self._next:
            return ""
        self._next = now + _LOOK_EVERY
        if self._realtime and not any(self._is_realtime(process) for process in self._realtime):
            return f"HAL's real-time side ({_REALTIME}) has ended"
        if not self._realtime and now >= self._next_search:
            self._next_search = now + _SEARCH_EVERY
            self._realtime = self._find()
        attached = self._attached()
        if attached is None:
            return "HAL's memory was removed" if self._had_memory else ""
        self._had_memory = True
        # Without a motor that turns, it is for nobody to mind: a shell that calls halcmd now and then is HAL as well.
        if attached > 1 or not turning:
            self._alone_since = None
        elif self._alone_since is None:
            self._alone_since = now
        elif now - self._alone_since >= _ALONE:
            return "nobody else is left on HAL's memory"
        return ""

    def _find(self) -> set[int]:
        return {int(each.name) for each in self._proc.glob("[0-9]*") if self._is_realtime(int(each.name))}

    def _is_realtime(self, process: int) -> bool:
        """Whether *process* is the real-time side, and no corpse of it."""
        try:
            told = (self._proc / str(process) / "stat").read_text(encoding="utf-8", errors="replace")
        except OSError:
            return False
        name, _, rest = told.partition("(")[2].rpartition(")")
        return name == _REALTIME and rest.split()[:1] != ["Z"]

    def _attached(self) -> int | None:
        """How many processes have HAL's memory; None where there is none that the system tells of."""
        try:
            lines = (self._proc / "sysvipc" / "shm").read_text(encoding="ascii").splitlines()
        except OSError:
            return None
        head = lines[0].split() if lines else []
        for line in lines[1:]:
            row = dict(zip(head, line.split(), strict=False))
            if row.get("key") == str(_KEY):
                return int(row["nattch"])
        return None
