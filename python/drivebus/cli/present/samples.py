"""Samples of drives as they come: a screen for who watches, CSV for a file or a pipe, objects for a program."""

from __future__ import annotations

import csv
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, Protocol

import drivebus
from drivebus.cli.present.csv_rows import titled
from drivebus.cli.present.errors import exit_code
from drivebus.cli.present.moments import moment
from drivebus.cli.present.output import Output, printable
from drivebus.cli.present.screen import Screen, Watched

__all__ = ["SampleView", "view_for"]


class SampleView(Protocol):
    """Where samples go.

    Attributes:
        is_lossless: Whether each sample stands there in the end, so that one that is left out must be told.
    """

    is_lossless: bool

    def shown(self) -> AbstractContextManager[object]:
        """The block in which samples come."""

    def show(self, drive: Watched, sample: drivebus.Sample) -> None:
        """One sample of *drive*, which has taken it."""

    def end(self) -> None:
        """No more come."""


def view_for(out: Output, drives: Sequence[Watched]) -> SampleView:
    """What shows samples of *drives* to whom *out* is for."""
    if out.live:
        return _OnScreen(out, drives)
    return _AsObjects(out, drives) if out.as_json else _AsCsv(drives)


class _OnScreen:
    """The latest values, and the least and greatest so far; the last of them stays on the terminal."""

    is_lossless = False

    def __init__(self, out: Output, drives: Sequence[Watched]) -> None:
        from rich.live import Live

        self._out = out
        self._screen = Screen(drives)
        self._live = Live(self._screen, console=out.console, auto_refresh=False, screen=True)
        self._is_empty = True

    def shown(self) -> AbstractContextManager[object]:
        return self._live

    def show(self, _drive: Watched, sample: drivebus.Sample) -> None:
        self._is_empty = False
        self._screen.take(sample.time)
        self._live.refresh()

    def end(self) -> None:
        if not self._is_empty:
            self._out.console.print(self._screen)


class _AsObjects:
    """An object for each sample; what is not verified is marked."""

    is_lossless = True

    def __init__(self, out: Output, drives: Sequence[Watched]) -> None:
        self._out = out
        self._named = len(drives) > 1

    def shown(self) -> AbstractContextManager[object]:
        return nullcontext()

    def show(self, drive: Watched, sample: drivebus.Sample) -> None:
        whose = {"drive": drive.name} if self._named else {}
        self._out.record({"time": moment(sample.time), **whose, **self._told(drive, sample)})

    @staticmethod
    def _told(drive: Watched, sample: drivebus.Sample) -> Mapping[str, Any]:
        if sample.missing is not None:
            return {"missing": str(sample.missing), "exit_code": exit_code(sample.missing)}
        values = {name: sample[name] for name in drive.rows}
        units = {name: row.unit for name, row in drive.rows.items() if row.unit}
        return {**values, "units": units, **({"evidence": drive.doubtful} if drive.doubtful else {})}

    def end(self) -> None:
        pass


class _AsCsv:
    """A line of CSV for each sample, behind one with the names of its columns; what is not verified is marked there."""

    is_lossless = True

    def __init__(self, drives: Sequence[Watched]) -> None:
        self._csv = csv.writer(sys.stdout, lineterminator="\n")
        self._named = len(drives) > 1
        self._is_empty = True
        self._columns = {
            name: titled(row, drive.doubtful.get(name, "")) for drive in drives for name, row in drive.rows.items()
        }

    def shown(self) -> AbstractContextManager[object]:
        return nullcontext()

    def show(self, drive: Watched, sample: drivebus.Sample) -> None:
        whose = [drive.name] if self._named else []
        if self._is_empty:
            self._is_empty = False
            titles = ["time", *(["drive"] if self._named else []), *map(printable, self._columns.values()), "missing"]
            self._csv.writerow(titles)
        shown = sample.missing is None
        values = [drive.rows[name].text(sample[name]) if shown and name in drive.rows else "" for name in self._columns]
        why = "" if sample.missing is None else str(sample.missing)
        self._csv.writerow([moment(sample.time), *map(printable, (*whose, *values, why))])
        sys.stdout.flush()

    def end(self) -> None:
        pass
