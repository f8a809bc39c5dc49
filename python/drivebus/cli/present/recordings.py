"""What was recorded, and what was drawn of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import drivebus
from drivebus.cli.present.output import Output, counted, remark

if TYPE_CHECKING:
    from drivebus.plot import Picture

__all__ = ["Drawn", "Recorded"]


@dataclass(frozen=True)
class Recorded:
    """What *recorder* wrote."""

    recorder: drivebus.Recorder

    def records(self) -> Iterator[dict[str, Any]]:
        """The files, and what is in them and what is not."""
        recorder = self.recorder
        yield {
            "files": [str(path) for path in recorder.files],
            "rows": recorder.rows,
            "gaps": recorder.gaps,
            "missing": recorder.missing,
            "late": recorder.late,
            "lost": recorder.lost,
            "told": recorder.told,
        }

    def lay_out(self, out: Output) -> None:
        """The same; and what helps, if the line was too busy for what was asked."""
        recorder, (first, *others) = self.recorder, self.recorder.files
        into = f"{first} and {len(others)} more" if others else first
        whole = "" if recorder.late or recorder.lost else ", no gap"
        gaps = f", {counted(recorder.gaps, 'gap')} ({recorder.missing} samples missing)" if recorder.gaps else whole
        out.say(f"{recorder.rows} rows in {into}{gaps}.")
        if not recorder.late:
            return
        taken, missing = recorder.rows + recorder.lost, recorder.missing
        unanswered = f", {missing} without an answer" if missing else ""
        remark(
            f"{taken + missing + recorder.late} samples asked for, {taken} taken{unanswered}: {recorder.late} came too "
            "late, the line was busy. A longer --interval, fewer registers or fewer programs on the line help."
        )


@dataclass(frozen=True)
class Drawn:
    """A *picture* in *file*, of a recording that is *complete* or not."""

    picture: Picture
    file: Path
    complete: bool

    def _curves(self) -> int:
        return sum(map(len, self.picture.panels.values()))

    def records(self) -> Iterator[dict[str, Any]]:
        """Where it is, and what is in it."""
        yield {
            "picture": str(self.file),
            "complete": self.complete,
            "left_out": self.picture.left_out,
            "curves": self._curves(),
        }

    def lay_out(self, out: Output) -> None:
        """The same, and what to know of it."""
        picture = self.picture
        bits = len({band.drive for band in picture.bands if band.lamp})
        lamps = f" and {counted(bits, 'bit')}" if bits else ""
        out.say(f"{counted(self._curves(), 'curve')}{lamps} in {self.file}.")
        if picture.late:
            remark(
                f"The line was busy {counted(picture.late, 'time')}, so samples are missing there: a curve goes "
                "straight to the next sample, and a band begins with it."
            )
        if picture.left_out:
            remark(
                f"Left out, because they were 0 all the time: {', '.join(picture.left_out)}. --only NAME draws them."
            )
        if not self.complete:
            remark("The recording has no end: it is still written, or was cut off.")
