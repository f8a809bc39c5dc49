"""The file of a capture while it is made: it begins with the first frame, so that one without frames leaves nothing."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import drivebus
from drivebus.capture import Captured, Writer
from drivebus.capture.standing import LOOK, Standing
from drivebus.cli.present.output import remark
from drivebus.cli.wrong_use import WrongUse

__all__ = ["CaptureFile"]


class CaptureFile:
    """A capture into *target*, for a `with` block. Opened at once, so that what cannot be written is told at once.

    Args:
        target: A file, or `-` for standard output.
        force: Whether a file that is there may be replaced. It is, with the first frame.
        port: The name of the line.
        settings: Its speed and characters, such as "19200 8E1".
        link: As for `drivebus.capture.Writer`.

    Raises:
        click.UsageError: The file is there.
        drivebus.NotAllowed: It cannot be written.

    Attributes:
        gone: Why the file was not there any more, while it was written; empty if it was.
    """

    def __init__(self, target: str, force: bool, port: str, settings: str, link: str) -> None:
        self._path = Path(target)
        self._about = (port, settings, link)
        self._writer: Writer | None = None
        self._is_new = False
        self._stream = self._opened(target, force)
        self._standing = Standing(self._path, os.fstat(self._stream.fileno())) if target != "-" else None
        self._look_at = float("-inf")
        self.gone = ""
        if not self._may_be_changed():
            self._begin()

    @property
    def is_empty(self) -> bool:
        """Whether nothing was written."""
        return self._writer is None

    def write(self, frame: Captured) -> None:
        """Writes *frame*, if the file is there still.

        Raises:
            OSError: The disk is full, or who read the pipe has gone.
        """
        if (frame.time or 0.0) >= self._look_at:
            self._look_at = (frame.time or 0.0) + LOOK
            self._look()
        if self.gone:
            return
        (self._writer or self._begin()).write(frame)

    def __enter__(self) -> CaptureFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._look()
        self._stream.close()
        # What was there before is not ours, and neither is what stands there now in its place.
        if self._is_new and self.is_empty and not self.gone:
            self._path.unlink(missing_ok=True)

    def _look(self) -> None:
        """Says, once, that the file does not stand any more where it was made."""
        if self.gone or self._standing is None:
            return
        self.gone = self._standing.gone()
        if self.gone:
            remark(f"Warning: {self._path} was not there any more: {self.gone}; nothing more is kept.")

    def _opened(self, target: str, force: bool) -> BinaryIO:
        if target == "-":
            return io.BufferedWriter(io.FileIO(sys.stdout.fileno(), "wb", closefd=False))
        try:
            if not self._path.exists():
                stream = self._path.open("xb")
                self._is_new = True
                return stream
            # One that is empty has nothing to lose.
            if not force and not (self._path.is_file() and self._path.stat().st_size == 0):
                raise FileExistsError
            return self._path.open("r+b" if self._path.is_file() else "wb")
        except FileExistsError:
            raise WrongUse(f"{target} is there already; give another name, or --force") from None
        except OSError as error:
            raise drivebus.NotAllowed(f"{target} cannot be written: {error.strerror}; nothing was opened") from None

    def _may_be_changed(self) -> bool:
        """Whether what was written is no news to anybody yet: it is a file, and no pipe."""
        return self._is_new or (self._stream.seekable() and self._path.is_file())

    def _begin(self) -> Writer:
        if self._may_be_changed():
            self._stream.truncate(0)
        port, settings, link = self._about
        self._writer = writer = Writer(self._stream, port, settings, link)
        return writer
