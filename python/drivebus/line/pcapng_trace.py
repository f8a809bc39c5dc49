"""The frames of a bus as a file that Wireshark opens: what `Bus(trace=…)` writes."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from time import time
from typing import BinaryIO, cast

from drivebus import checks
from drivebus._native import SerialFormat
from drivebus.capture import Captured, Writer
from drivebus.capture.standing import LOOK, Standing
from drivebus.errors import BadArgument, DrivebusWarning, NotAllowed

__all__ = ["WireFile"]


class WireFile:
    """A capture of one bus, from its opening to its end. What is written there already is replaced.

    Args:
        path: The file.
        port: The name of the port.
        line: How characters look on it.

    Raises:
        NotAllowed: The file cannot be written; nothing was opened.
    """

    def __init__(self, path: object, port: str, line: SerialFormat) -> None:
        if not isinstance(path, (str, os.PathLike)) or not os.fspath(path):
            raise BadArgument(f"trace is {checks.shown(path)}, which is not a file; give the path of a pcapng file")
        self._name = str(os.fspath(path))
        settings = f"{line.baudrate} {line.bytesize}{line.parity}{line.stopbits}"
        try:
            self._stream = cast(BinaryIO, Path(self._name).open("wb", buffering=0))  # noqa: SIM115 - open as long as the bus
        except (OSError, ValueError) as error:
            raise self._unwritten(error) from None
        try:
            self._writer = Writer(self._stream, port, settings)
        except OSError as error:
            self._close()
            raise self._unwritten(error) from None
        self._ahead = 0.0
        self._standing = Standing(Path(self._name), os.fstat(self._stream.fileno()))
        self._look_at = float("-inf")

    def _unwritten(self, error: OSError | ValueError) -> NotAllowed:
        reason = (error.strerror if isinstance(error, OSError) else None) or error
        return NotAllowed(f"{self._name} cannot be written: {reason}; nothing was opened")

    def begin(self, now: float) -> None:
        """The line's clock stands at *now*."""
        self._ahead = time() - now

    def write(self, at: float, sent: bool, frame: bytes) -> None:
        """Writes *frame*, which went over the line at *at*.

        A disk that is full, or a file that is not there any more, ends the file, and not the line.
        """
        if not self._stream.closed and at >= self._look_at:
            self._look_at = at + LOOK
            self._look()
        if self._stream.closed:
            return
        try:
            self._writer.write(Captured(at + self._ahead, frame, sent))
        except OSError as error:
            self._close()
            warnings.warn(
                f"{self._name} is not written any more: {error.strerror or error}", DrivebusWarning, stacklevel=2
            )

    def _look(self) -> None:
        """Ends the file and says so if it does not stand where it was made."""
        why = self._standing.gone()
        if why:
            self._close()
            warnings.warn(
                f"{self._name} was not there any more: {why}; nothing more is kept",
                DrivebusWarning,
                stacklevel=3,
            )

    def end(self) -> None:
        """Closes the file."""
        if not self._stream.closed:
            self._look()
        self._close()

    def _close(self) -> None:
        try:
            self._stream.close()
        except OSError:  # it was said when it was written
            return
