"""What happens between samples: answers that are missing or too late, faults, and their ends, as rows of their own."""

from __future__ import annotations

from collections.abc import Iterator

from drivebus.line.poll_samples import Sample
from drivebus.record.table import Recorded, Row, Table

__all__ = ["Witness"]


class Witness:
    """Makes rows of the samples of one drive.

    `gap` stands where answers began to be missing, with the reason of the first; `back` where they came again, with how
    many were missing and how long. `late` stands before a sample that was to come after others, which were not taken
    because the line was busy. `fault` and `fault cleared` stand before the first sample that shows it.

    Args:
        drive: Whose samples they are.
        table: The columns.

    Attributes:
        missing: Samples without values so far.
        late: Samples that were due so far and were not taken, because the line was busy.
    """

    def __init__(self, drive: Recorded, table: Table) -> None:
        self._drive = drive
        self._table = table
        self._gap: tuple[float, int] | None = None
        self._before = 0.0
        self._fault = 0
        self.missing = 0
        self.late = 0

    def rows(self, sample: Sample) -> Iterator[Row]:
        """The rows that *sample* makes."""
        label = self._drive.label
        before, self._before = self._before, sample.time
        if sample.late:
            self.late += sample.late
            samples = "1 sample was" if sample.late == 1 else f"{sample.late} samples were"
            yield Row(
                sample.time,
                label,
                "late",
                f"{samples} due in the {sample.time - before:.3f} s before, and not taken: the line was busy",
            )
        if sample.missing is not None:
            self.missing += 1
            began, lost = self._gap or (sample.time, 0)
            self._gap = began, lost + 1
            if not lost:
                yield Row(sample.time, label, "gap", str(sample.missing))
            return
        if self._gap is not None:
            began, lost = self._gap
            self._gap = None
            samples = "1 sample was" if lost == 1 else f"{lost} samples were"
            yield Row(sample.time, label, "back", f"{samples} missing in {sample.time - began:.3f} s")
        word = 0 if self._drive.fault is None else int(sample[self._drive.fault])
        fault = self._drive.profile.fault_number(word)
        if fault != self._fault:
            self._fault = fault
            told = str(self._drive.profile.fault(fault)) if fault else ""
            yield Row(sample.time, label, "fault" if fault else "fault cleared", told)
        state = ""
        if self._drive.state is not None:
            state = self._drive.profile.state(int(sample[self._drive.state])).replace("_", " ")
        yield Row(sample.time, label, "", "", state, self._table.values(label, sample))
