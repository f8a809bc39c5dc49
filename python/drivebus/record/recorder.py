"""Records drives into a file while they are polled."""

from __future__ import annotations

import os
import threading
import warnings
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Any

from drivebus import _native, checks
from drivebus.bus import Bus
from drivebus.drive import Drive, check_drive
from drivebus.errors import BadArgument, DrivebusWarning, NotAllowed
from drivebus.latch import Latch
from drivebus.line.poll_samples import Names, Sample
from drivebus.operations.drive_base import DriveFace
from drivebus.poll import Poll, never_run
from drivebus.record.formats import format_of
from drivebus.record.gap_events import Witness
from drivebus.record.series import Series
from drivebus.record.table import Recorded, Table
from drivebus.strict_attributes import known_only

__all__ = ["Recorder"]

_LOOK_UP = 0.1
"""Seconds between two looks at what has come."""

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
    tells the drives, lines, profiles and registers as JSON; the last is the `end`. A file without that was cut off. A
    CSV file has words in its first row, and the JSON in a row `about` before the `end`.

    Nothing older than a second is lost if this program is killed. If the disk is full, a warning says so, rows are kept
    in memory (100 000 at most), and the file goes on when there is room. If the file is removed, renamed or replaced,
    which is looked at once a second, a warning says so at once, and a new file goes on at its path, or at `run-2.csv`
    where something else stands there now, with all its rows as far as they can still be read.

    On a line in virtual time nothing is recorded by itself: `wait` lets time move. What was due meanwhile and never
    ran, the `end` tells.

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
        lost: Rows that gave way because the file could not be written, or that went with a file that is gone.
        told: What befell the files, as it was warned of: one that was not there any more, one that has no end.
        problem: Why the file cannot be written now; empty if it can.
    """

    gaps: int

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
        place = Path(path)
        format_of(place)
        most = None if rotate_bytes is None else checks.whole("rotate_bytes", rotate_bytes, 1, _LARGEST)
        longest = (
            None
            if rotate_seconds is None
            else checks.number("rotate_seconds", rotate_seconds, 0.0, _LONGEST, above=True)
        )
        recorded = _recorded(drives, labels or {}, state)
        table = Table(list(recorded.values()), interval, _native.__version__)
        self._witnesses = {drive: Witness(known, table) for drive, known in recorded.items()}
        self.gaps = 0
        self._never_run = ""
        self._over = Latch()
        self._lock = threading.Lock()
        by_bus: dict[Bus, dict[Drive, list[str]]] = {}
        for drive, known in recorded.items():
            assert isinstance(drive.bus, Bus)
            by_bus.setdefault(drive.bus, {})[drive] = known.asked
        self._virtual = all(isinstance(bus.line, _native.Bus) and bus.line.virtual for bus in by_bus)
        self._now = next(iter(by_bus)).now if self._virtual else monotonic
        self._series = Series(
            place, table, self._now(), replace=replace, most=most, longest=longest, counted=self._counted
        )
        self._polls: list[Poll[Drive]] = []
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
    def files(self) -> list[Path]:
        """The files so far, the newest last."""
        return self._series.files

    @property
    def rows(self) -> int:
        """Rows with values that are in the files."""
        return self._series.rows

    @property
    def lost(self) -> int:
        """Rows that gave way because the file could not be written, or that went with a file that is gone."""
        return self._series.lost

    @property
    def told(self) -> list[str]:
        """What befell the files, as it was warned of: one that was not there any more, one that has no end."""
        return self._series.told

    @property
    def problem(self) -> str:
        """Why the file cannot be written now; empty if it can."""
        return self._series.problem

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
        with self._lock:
            return self._series.size

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
                self._series.write(self._now(), flush=True)
        return self.closed

    def close(self) -> None:
        """Ends it: what has come is written, the file gets its `end`, and is closed. Closing again does nothing.

        Raises:
            OSError: The last rows cannot be written, or the file is gone and cannot be begun anew. The error says how
                many rows are lost.
        """
        if not self.closed:
            self._never_run = ", ".join(filter(None, map(never_run, self._polls)))
        for poll in self._polls:
            poll.close()
        self._over.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        with self._lock:
            self._take()
            self._series.close(self._now())

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
                self._series.write(self._now())
            if all(poll.closed for poll in self._polls):
                self._over.set()

    def _take(self) -> None:
        """Makes rows of what has come."""
        samples: list[Sample] = [sample for poll in self._polls for sample in poll.take()]
        if len(self._polls) > 1:
            samples.sort(key=lambda sample: sample.time)
        for sample in samples:
            rows = list(self._witnesses[sample.key].rows(sample))
            self.gaps += sum(row.event == "gap" for row in rows)
            self._series.add(rows)

    def _counted(self) -> str:
        never = f", {self._never_run} due and never run" if self._never_run else ""
        return f"{self.rows} rows, {self.missing} samples missing, {self.late} too late{never}"

    def _give_up(self) -> None:
        """No drive is polled: the file that was begun goes."""
        for poll in self._polls:
            poll.close()
        self._series.give_up()


def _recorded(drives: Any, labels: Mapping[Drive, str], state: bool) -> dict[Drive, Recorded]:
    """What is recorded of each of *drives*."""
    if not isinstance(drives, Mapping) or not drives or not all(isinstance(drive, DriveFace) for drive in drives):
        raise BadArgument(f"drives is {checks.shown(drives)}; give {{drive: names, …}}, such as {{drive: None}}")
    for drive in drives:
        check_drive(drive, "a Recorder")
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
        raise BadArgument(f'two drives are called "{twice}"; give each a label of its own')
    return found


def _readable(drive: Drive, role: str) -> str | None:
    """The register that has *role*, if it may be read."""
    name = drive.profile.role(role)
    try:
        return name and drive.readable(name)[0]
    except NotAllowed:
        return None
