"""The frames on a line, as records of the logger `drivebus.wire`: time, gap, direction, bytes and meaning."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, Protocol

from drivebus.line.units import Units

if TYPE_CHECKING:
    from drivebus.line.pcapng_trace import WireFile

__all__ = ["LOGGER", "Trace"]

LOGGER = "drivebus.wire"
"""The logger that has a record of level DEBUG for each frame."""


class _Watched(Protocol):
    """A bus of the core, as far as it is watched."""

    def watch(self, function: Any, /) -> None: ...
    def now(self) -> float: ...


class Trace:
    """Logs each frame of a line with what it means, and keeps it in a file, as far as either is wanted.

    Args:
        known: The families of its units, as far as they are known.
        file: Where frames are kept; None keeps none.
    """

    def __init__(self, known: Units, file: WireFile | None) -> None:
        self._native: _Watched | None = None
        self._known = known
        self._file = file
        self._logs = False
        self._asked: bytes | None = None

    def begin(self, native: _Watched) -> None:
        """The line is open. Who never imported `logging` does not want its records."""
        self._native = native
        logging = sys.modules.get("logging")
        self._logs = logging is not None and logging.getLogger(LOGGER).isEnabledFor(logging.DEBUG)
        if self._file is not None:
            self._file.begin(native.now())
        if self._logs or self._file is not None:
            native.watch(self._show)

    def switch(self, on: bool) -> None:
        """Begins to log, or ends."""
        self._logs = on
        if self._native is not None:
            self._native.watch(self._show if on or self._file is not None else None)

    def end(self) -> None:
        """The line is closed."""
        if self._file is not None:
            self._file.end()

    def _show(self, at: float, gap: float | None, sent: bool, frame: bytes, elsewhere: bool) -> None:
        if self._file is not None:
            self._file.write(at, sent, frame)
        if self._logs:
            self._log(at, gap, sent, frame, elsewhere)

    def _log(self, at: float, gap: float | None, sent: bool, frame: bytes, elsewhere: bool) -> None:
        import logging

        from drivebus.line.meaning import meaning

        asked, self._asked = self._asked, frame if sent else self._asked
        logger = logging.getLogger(LOGGER)
        if not logger.isEnabledFor(logging.DEBUG):
            return
        profile = self._known.only(frame[0]) if frame else None
        means = meaning(frame, sent, asked, profile)
        extra = {"line_time": at, "gap": gap, "sent": sent, "frame": frame, "meaning": means, "elsewhere": elsewhere}
        logger.debug(
            "%12s  %s %s  %s%s",
            "" if gap is None else f"+{gap * 1e3:.3f} ms",
            "->" if sent else "<-",
            frame.hex(" ").upper(),
            means,
            " (by the program that has the port)" if elsewhere else "",
            extra=extra,
        )
