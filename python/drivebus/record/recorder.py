"""Records drives into a file while they are polled."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from time import monotonic, time
from types import TracebackType
from typing import Any

from drivebus import _native, checks
from drivebus.attributes import known_only
from drivebus.bus import Bus
from drivebus.drive import Drive
from drivebus.errors import DrivebusWarning, NotAllowed
from drivebus.line.samples import Names, Sample
from drivebus.poll import Poll
from drivebus.record.events import Witness
from drivebus.record.files import Sink, format_of, sink_for
from drivebus.record.table import Recorded, Row, Table

__all__ = ["Recorder"]

_LOOK_UP = 0.1
"""Seconds between two looks at what has come."""

_KEPT = 100_000
"""Rows that wait while the file cannot be written; the oldest give way."""

_AGAIN = 1.0
"""Seconds after which a file that could not be written is tried again."""

_LARGEST = 1 << 50
_LONGEST = 31_536_000.0


@known_only
class Recorder:
    """Records values of drives into a file, in a thread of its own, until it is closed.

        with drivebus.Recorder("run.csv", {drive: None}, interval=0.1):
            drive.wait_for_speed(timeout=30)

    The end of the name says the format: `.csv`, `.jsonl`, `.sqlite`, `.db` or `.parquet` (`pip install
    'drivebus[parquet]'`). All have the same columns: `time`, `drive`, `event`, `text`, `state`, and one for each
    register, with its unit: `output_current [A]`. A row without an `event` has values. Gaps and faults are rows of
    their own: `gap`, `back`, `late`, `fault`, `fault cleared`, `lost`. The first row is the `recording`, whose text
    tells the drives, lines, profiles and registers as JSON; the last is the `end`. A file without that was cut off.

    Nothing older than a second is lost if this program is killed. If the disk is full, a warning says so, rows are kept
    in memory (100 000 at most), and the file goes on when there is room.

    On a line in virtual time nothing is recorded by itself: `wait` lets time move.

    Args:
        path: The file.
        drives: What is recorded, as `Bus.poll` takes it: names of registers or parameters for each drive, None for its
            monitor registers. The drives may be of several buses.
        interval: Seconds from one sample to the next; None: as fast as the line allows.
        labels: What each drive is called in the file. Default: `unit 1`, with its port if there are several.
        state: Whether state and fault of each drive are recorded too, where they may be read.
        rotate_bytes: The file ends when it has so many bytes, and `run-2.csv` begins, and so on. None: never.
        rotate_seconds: The same after so many seconds.
        replace: Whether a file that is there already is replaced.

    Raises:
        NotAllowed: An argument is wrong, or the file cannot be written. Nothing was asked.

    Attributes:
        files: The files so far, the newest last.
        rows: Rows with values that are in the files.
        gaps: Times at which a drive began to be missing.
        missing: Samples without values.
        late: Samples that were due and were not taken, because the line was busy.
        lost: Rows that gave way because the file could not be written.
        problem: Why the file cannot be written now; empty if it can.
    """

    files: list[Path]
    rows: int
    gaps: int
    lost: int
    problem: str

    def __init__(
        self,
        path: str | os.PathLike[str],
        drives: Mapping[Drive, Names],
        *,
        interval: float | None = None,
        labels: Mapping[Drive, str] | None = None,
        state: bool = True,
        rotate_bytes: int | None = None,
        rotate_seconds: float | None = None,
        replace: bool = False,
    ) -> None:
        self._path = Path(path)
        format_of(self._path)
        self._most = None if rotate_bytes is None else checks.whole("rotate_bytes", rotate_bytes, 1, _LARGEST)
        self._longest = (
            None
            if rotate_seconds is None
            else checks.number("rotate_seconds", rotate_seconds, 0.0, _LONGEST, above=True)
        )
        self._replace = replace
        recorded = _recorded(drives, labels or {}, state)
        self._table = Table(list(recorded.values()), interval, _native.__version__)
        self._witnesses = {drive: Witness(known, self._table) for drive, known in recorded.items()}
        self.files = []
        self.rows = self.gaps = self.lost = 0
        self.problem = ""
        self._waiting: list[Row] = []
        self._lost_now = 0
        self._retry_at = self._written_at = 0.0
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._sink: Sink | None = self._open(self._path)
        by_bus: dict[Bus, dict[Drive, list[str]]] = {}
        for drive, known in recorded.items():
            assert isinstance(drive.bus, Bus)
            by_bus.setdefault(drive.bus, {})[drive] = known.asked
        self._polls: list[Poll[Drive]] = []
        self._virtual = all(isinstance(bus.line, _native.Bus) and bus.line.virtual for bus in by_bus)
        with ExitStack() as undone:
            undone.callback(self._give_up)
            for bus, wanted in by_bus.items():
                self._polls.append(bus.poll(wanted, interval))
            undone.pop_all()
        self._thread = (
            None if self._virtual else threading.Thread(target=self._record, name="drivebus record", daemon=True)
        )
        if self._thread is not None:
            self._thread.start()

    @property
    def missing(self) -> int:
        """Samples without values so far."""
        return sum(witness.missing for witness in self._witnesses.values())

    @property
    def late(self) -> int:
        """Samples that were due so far and were not taken, because the line was busy."""
        return sum(witness.late for witness in self._witnesses.values())

    @property
    def size(self) -> int:
        """Bytes of the newest file."""
        with self._lock, suppress(OSError):
            return 0 if self._sink is None else self._sink.size()
        return 0

    @property
    def closed(self) -> bool:
        """Whether it has ended: it was closed, or the lines were."""
        return self._over.is_set()

    def wait(self, timeout: float | None = None) -> bool:
        """Waits until it has ended, for *timeout* seconds of the line's clock at most; returns whether it has."""
        limit = None if timeout is None else checks.number("timeout", timeout, 0.0, _LONGEST)
        if not self._virtual:
            return self._over.wait(limit)
        for poll in self._polls:
            poll.wait(limit)
            with self._lock:
                self._take()
                self._write(flush=True)
        return self.closed

    def close(self) -> None:
        """Ends it: what has come is written, the file gets its `end`, and is closed. Closing again does nothing.

        Raises:
            OSError: The last rows cannot be written. The error says how many are lost.
        """
        for poll in self._polls:
            poll.close()
        self._over.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        with self._lock:
            if self._sink is None:
                return
            self._take()
            self._retry_at = 0.0
            self._write(flush=True)
            sink, self._sink = self._sink, None
            left = [row for row in self._waiting if not row.event]
            try:
                if not left:
                    sink.write([*self._waiting, self._end_row()])
                sink.close()
            except OSError as error:
                self.problem = self.problem or str(error.strerror or error)
        if left or self.problem:
            self.lost += len(left)
            raise OSError(f"{sink.path} could not be ended: {self.problem}; the last {len(left)} rows are lost")

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except OSError as failed:
            if error is None:
                raise
            warnings.warn(str(failed), DrivebusWarning, stacklevel=2)

    def __repr__(self) -> str:
        return f"<Recorder {self.files[-1]}: {self.rows} rows{', closed' if self.closed else ''}>"

    def _record(self) -> None:
        """Takes and writes until it is over, in the recorder's thread."""
        while not self._over.wait(_LOOK_UP):
            with self._lock:
                self._take()
                self._write()
            if all(poll.closed for poll in self._polls):
                self._over.set()

    def _take(self) -> None:
        """Makes rows of what has come."""
        samples: list[Sample] = [sample for poll in self._polls for sample in poll.take()]
        if len(self._polls) > 1:
            samples.sort(key=lambda sample: sample.time)
        for sample in samples:
            rows = list(self._witnesses[sample.drive].rows(sample))
            self.gaps += sum(row.event == "gap" for row in rows)
            self._waiting += rows
        surplus = len(self._waiting) - _KEPT
        if surplus > 0:
            del self._waiting[:surplus]
            self.lost += surplus
            self._lost_now += surplus

    def _write(self, flush: bool = False) -> None:
        """Writes what waits, when it is due."""
        now = monotonic()
        sink = self._sink
        if sink is None or not self._waiting or now < self._retry_at:
            return
        if not flush and now - self._written_at < sink.every - _LOOK_UP / 2:
            return
        rows = self._waiting
        if self._lost_now:
            reason = f"{self._lost_now} rows are not here: {self.problem or 'the file could not be written'}"
            rows = [Row(rows[0].time, "", "lost", reason), *rows]
        try:
            sink.write(rows)
        except OSError as error:
            reason = str(error.strerror or error)
            if not self.problem:
                warnings.warn(
                    f"{sink.path} cannot be written now: {reason}; rows are kept, and it is tried again",
                    DrivebusWarning,
                    stacklevel=2,
                )
            self.problem, self._retry_at = reason, now + _AGAIN
            return
        self.problem, self._lost_now, self._written_at = "", 0, now
        self.rows += sum(not row.event for row in rows)
        self._waiting = []
        self._rotate(sink, now)

    def _rotate(self, sink: Sink, now: float) -> None:
        """Begins the next file if this one is large or old enough."""
        is_full = self._most is not None and sink.size() >= self._most
        is_old = self._longest is not None and now - self._began >= self._longest
        if self._over.is_set() or not (is_full or is_old):
            return
        number = len(self.files) + 1
        while (path := self._path.with_name(f"{self._path.stem}-{number}{self._path.suffix}")).exists():
            if self._replace:
                break
            number += 1
        try:
            following = self._open(path)
        except NotAllowed as error:
            self.problem = str(error)
            return
        try:
            sink.write([self._end_row(f"; goes on in {path.name}")])
            sink.close()
        except OSError as error:
            warnings.warn(f"{sink.path} has no end: {error.strerror or error}", DrivebusWarning, stacklevel=2)
        self._sink = following

    def _open(self, path: Path) -> Sink:
        """A new file, with its first row."""
        sink = sink_for(path, self._table, self._replace)
        self._began, started = monotonic(), time()
        try:
            sink.write([Row(started, "", "recording", self._table.about(started))])
        except OSError as error:
            with suppress(OSError):
                sink.close()
            path.unlink(missing_ok=True)
            raise NotAllowed(f"{path} cannot be written: {error.strerror or error}; nothing was recorded") from None
        self.files.append(path)
        return sink

    def _end_row(self, goes_on: str = "") -> Row:
        counted = f"{self.rows} rows, {self.missing} samples missing, {self.late} too late"
        return Row(time(), "", "end", f"{counted}{goes_on}")

    def _give_up(self) -> None:
        """No drive is polled: the file that was begun goes."""
        for poll in self._polls:
            poll.close()
        if self._sink is not None:
            with suppress(OSError):
                self._sink.close()
            self._sink.path.unlink(missing_ok=True)


def _recorded(drives: Any, labels: Mapping[Drive, str], state: bool) -> dict[Drive, Recorded]:
    """What is recorded of each of *drives*."""
    if not isinstance(drives, Mapping) or not drives or not all(isinstance(drive, Drive) for drive in drives):
        raise NotAllowed(f"drives is {checks.shown(drives)}; give {{drive: names, …}}, such as {{drive: None}}")
    several = len({id(drive.bus) for drive in drives}) > 1
    found: dict[Drive, Recorded] = {}
    for drive, names in drives.items():
        wanted = drive.readable() if names is None else drive.readable(*([names] if isinstance(names, str) else names))
        if names is None:
            # What the drive is does not change while it is recorded.
            wanted = [name for name in wanted if not name.startswith("identification")]
        line = drive.bus.format
        settings = f"{line.baudrate} {line.bytesize}{line.parity}{line.stopbits}"
        usual = f"unit {drive.unit}" + (f" of {drive.bus.port}" if several else "")
        told = {role: _readable(drive, role) if state else None for role in ("state", "fault")}
        found[drive] = Recorded(
            labels.get(drive, usual),
            drive.unit,
            f"{drive.bus.port} {settings}",
            drive.profile,
            {name: drive.describe(name) for name in wanted},
            told["state"],
            told["fault"],
        )
    names_in_file = [known.label for known in found.values()]
    twice = next((name for name in names_in_file if names_in_file.count(name) > 1), None)
    if twice is not None:
        raise NotAllowed(f'two drives are called "{twice}"; give each a label of its own')
    return found


def _readable(drive: Drive, role: str) -> str | None:
    """The register that has *role*, if it may be read."""
    name = drive.profile.role(role)
    try:
        return name and drive.readable(name)[0]
    except NotAllowed:
        return None
