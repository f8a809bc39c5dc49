"""The files of one recording, one after the other: what waits to be written, when, and whether it is still there.

Time is an argument: nothing here sleeps, and nothing reads a clock but for the moments that stand in rows.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from time import time

from drivebus.capture.standing import LOOK
from drivebus.errors import DrivebusWarning, NotAllowed
from drivebus.record.formats import Sink, sink_for
from drivebus.record.table import Row, Table

__all__ = ["Series"]

_KEPT = 100_000
"""Rows that wait while the file cannot be written; the oldest give way."""

_AGAIN = 1.0
"""Seconds after which a file that could not be written is tried again."""

_EARLY = 0.05
"""Seconds by which a write may come too early: the recorder looks up as often as that."""


class Series:
    """Writes rows into a file, and into the next when that is full, old, or not there any more.

    Args:
        path: The first file.
        table: The columns.
        now: The moment, in seconds of the caller's clock, as everywhere here.
        replace: Whether files that are there already are replaced.
        most, longest: Bytes and seconds after which the next file begins; None: never.
        counted: Tells, in words, what the `end` of a file says.

    Raises:
        NotAllowed: The file cannot be written. Nothing was changed.

    Attributes:
        files: The files so far, the newest last.
        rows: Rows with values that are in the files.
        lost: Rows that gave way because the file could not be written, or that were in a file that is gone.
        problem: Why the file cannot be written now; empty if it can.
        told: What befell the files, as it was told at once.
    """

    def __init__(
        self,
        path: Path,
        table: Table,
        now: float,
        *,
        replace: bool,
        most: int | None,
        longest: float | None,
        counted: Callable[[], str],
    ) -> None:
        self._path, self._home = path, path.absolute()
        self._table, self._replace = table, replace
        self._most, self._longest = most, longest
        self._counted = counted
        self.files: list[Path] = []
        self.rows = self.lost = 0
        self.problem = ""
        self.told: list[str] = []
        self._waiting: list[Row] = []
        self._lost_now = 0
        self._is_gone = False
        self._retry_at = self._written_at = float("-inf")
        self._began = self._look_at = now
        self._rows_before = 0
        self._about = ""
        self._sink: Sink | None = self._open(path, now)

    @property
    def size(self) -> int:
        """Bytes of the newest file."""
        with suppress(OSError):
            return 0 if self._sink is None else self._sink.size()
        return 0

    def add(self, rows: Sequence[Row]) -> None:
        """Takes *rows* that are to be written."""
        self._waiting += rows
        surplus = len(self._waiting) - _KEPT
        if surplus > 0:
            del self._waiting[:surplus]
            self.lost += surplus
            self._lost_now += surplus

    def write(self, now: float, *, flush: bool = False, last: bool = False) -> None:
        """Looks whether the file is there and writes what waits, when either is due.

        Args:
            now: The moment.
            flush: Write at once.
            last: It is the last time: no next file begins, and nothing is put off.
        """
        if self._sink is None or (now < self._retry_at and not last) or not self._is_there(now, last):
            return
        if not self._waiting or not (flush or last or now - self._written_at >= self._sink.every - _EARLY):
            return
        try:
            count = self._put(self._sink, now)
        except OSError as error:
            if not self._is_gone:
                self._put_off(str(error.strerror or error), now)
            return
        self.problem, self._lost_now, self._written_at = "", 0, now
        self.rows += count
        self._waiting = []
        if not last and self._sink is not None:
            self._rotate(self._sink, now)

    def close(self, now: float) -> None:
        """Writes what waits and the `end`, and closes the file. Closing again does nothing.

        Raises:
            OSError: Not all could be written. The error says how many rows are lost.
        """
        self.write(now, last=True)
        sink, self._sink = self._sink, None
        if sink is None:
            return
        waiting = sum(not row.event for row in self._waiting)
        if self._is_gone:
            inside = self.rows - self._rows_before
            self._lose(inside)
            self.lost += waiting
            with suppress(OSError):
                sink.close()
            raise OSError(
                f"{sink.path} is not there any more, and could not be begun anew: {self.problem}; {inside + waiting} "
                "rows are lost"
            )
        try:
            if not waiting:
                sink.write([*self._waiting, *self._last_rows(sink)])
            sink.close()
        except OSError as error:
            self.problem = self.problem or str(error.strerror or error)
        if waiting or self.problem:
            self.lost += waiting
            raise OSError(f"{sink.path} could not be ended: {self.problem}; the last {waiting} rows are lost")

    def give_up(self) -> None:
        """Takes back the file that was begun: there is nothing to record."""
        if self._sink is not None:
            with suppress(OSError):
                self._sink.close()
            self._sink.path.unlink(missing_ok=True)

    def _put(self, sink: Sink, now: float) -> int:
        """Writes what waits; how many rows with values that was.

        Raises:
            OSError: It cannot be written now.
        """
        rows = self._rows()
        try:
            sink.write(rows)
        except OSError:
            if not sink.gone() or not self._is_there(now, look=True) or self._sink is None:
                raise
            rows = self._rows()
            self._sink.write(rows)
        return sum(not row.event for row in rows)

    def _rows(self) -> list[Row]:
        """What waits, and before it how many rows gave way."""
        if not self._lost_now:
            return self._waiting
        reason = f"{self._lost_now} rows are not here: {self.problem or 'the file could not be written'}"
        return [Row(self._waiting[0].time, "", "lost", reason), *self._waiting]

    def _put_off(self, reason: str, now: float) -> None:
        if not self.problem and self._sink is not None:
            warnings.warn(
                f"{self._sink.path} cannot be written now: {reason}; rows are kept, and it is tried again",
                DrivebusWarning,
                stacklevel=3,
            )
        self.problem, self._retry_at = reason, now + _AGAIN

    def _is_there(self, now: float, look: bool) -> bool:
        """Whether the file stands at its path, or goes on in a new one; once a second, or where *look* says so."""
        if self._sink is None or not (look or self._is_gone or now >= self._look_at):
            return True
        self._look_at = now + LOOK
        why = self._sink.gone()
        if why:
            return self._go_on(self._sink, why, now)
        self._is_gone = False
        return True

    def _go_on(self, sink: Sink, why: str, now: float) -> bool:
        """Begins a new file in the place of *sink*, which is gone, with what it has; whether that could be done."""
        old = f"{sink.path} was not there any more: {why}"
        try:
            path = self._free(sink.path)
            path.parent.mkdir(parents=True, exist_ok=True)
            lost = sink.move(path)
            if lost is None:
                self._sink = self._open(path, now)
                self.files.pop()
                lost = self.rows - self._rows_before
                with suppress(OSError):
                    sink.close()
        except (OSError, NotAllowed) as error:
            reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
            was_told, self._is_gone = self._is_gone, True
            self.problem, self._retry_at = reason, now + _AGAIN
            if not was_told:
                self._tell(f"{old}. It cannot be begun anew now: {reason}; rows are kept, and it is tried again")
            return False
        self._is_gone, self.problem = False, ""
        self.files[-1] = path
        self._lose(lost)
        told = f"{old}. It goes on in {path}, {f'and {lost} rows are lost' if lost else 'with all its rows'}"
        self._waiting.insert(0, Row(time(), "", "moved", told))
        self._tell(told)
        return True

    def _free(self, path: Path) -> Path:
        """*path* if nothing stands there, or the next name: what stands there is somebody else's."""
        path = self._base().with_name(path.name)
        return self._following(replace=False) if os.path.lexists(path) else path

    def _following(self, *, replace: bool) -> Path:
        """The name of the next file: `run-2.csv`, then `run-3.csv`, and so on."""
        base = self._base()
        number = len(self.files) + 1
        while os.path.lexists(path := base.with_name(f"{base.stem}-{number}{base.suffix}")):
            if replace and path not in self.files:
                break
            number += 1
        return path

    def _base(self) -> Path:
        """The first file's path, as it was given unless the program has another working folder by now."""
        return self._path if self._path.absolute() == self._home else self._home

    def _lose(self, count: int) -> None:
        """*count* rows that were in the newest file are not."""
        self.rows -= count
        self.lost += count

    def _tell(self, text: str) -> None:
        self.told.append(text)
        warnings.warn(text, DrivebusWarning, stacklevel=4)

    def _rotate(self, sink: Sink, now: float) -> None:
        """Begins the next file if this one is large or old enough."""
        is_full = self._most is not None and self.size >= self._most
        is_old = self._longest is not None and now - self._began >= self._longest
        if not (is_full or is_old):
            return
        path = self._following(replace=self._replace)
        try:
            following = self._open(path, now)
        except NotAllowed as error:
            self.problem = str(error)
            return
        self._sink = following
        try:
            sink.write(self._last_rows(sink, f"; goes on in {path.name}"))
            sink.close()
        except OSError as error:
            self._tell(f"{sink.path} has no end: {error.strerror or error}")

    def _open(self, path: Path, now: float) -> Sink:
        """A new file, with its first row."""
        sink = sink_for(path, self._table, self._replace)
        started = time()
        about = self._table.about(started)
        try:
            sink.write([Row(started, "", "recording", self._table.in_words() if sink.about_last else about)])
        except OSError as error:
            with suppress(OSError):
                sink.close()
            path.unlink(missing_ok=True)
            raise NotAllowed(f"{path} cannot be written: {error.strerror or error}; nothing was recorded") from None
        self.files.append(path)
        self._about = about
        self._began, self._look_at, self._rows_before = now, now + LOOK, self.rows
        return sink

    def _last_rows(self, sink: Sink, goes_on: str = "") -> list[Row]:
        now = time()
        about = [Row(now, "", "about", self._about)] if sink.about_last else []
        return [*about, Row(now, "", "end", f"{self._counted()}{goes_on}")]
