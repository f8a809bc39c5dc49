"""The screen of `drivebus monitor`: what several drives say, laid out so that all of it fits the terminal.

A wide terminal gets the least and the greatest of each value, and as many blocks of rows beside each other as it takes;
a small one gets the values only. What does not fit even so is counted, and never cut.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.table import Table
from rich.text import Text

import drivebus
from drivebus.cli.present.output import printable

__all__ = ["MARKS", "Screen", "Watched", "meaning"]

_BETWEEN = 3
"""Blanks between two blocks of rows."""
_RATED = 20
"""Samples over which the rate is told."""

MARKS = {"unverified": "?", "assumed": "!"}
"""What stands behind a value that is not proved, by its evidence."""

_STYLES = {"fault": "bold red", "forward": "green", "reverse": "green", "running": "green"}


@dataclass
class Watched:
    """One drive that is watched.

    Attributes:
        name: What it is called.
        what: What is known of it, such as "Goodrive350 on /dev/ttyUSB0, unit 1".
        profile: What its words mean.
        rows: What is shown, by the name under which it comes.
        state, fault: The registers that tell them, if they are asked for.
        doubtful: Why a value is not sure, by its name.
        hint: What to know of what is shown; may be empty.
        now: The newest values; None while the newest sample is missing.
        least, greatest: Of each number so far.
        missing: Why the newest sample is missing.
    """

    name: str
    what: str
    profile: drivebus.Profile
    rows: Mapping[str, drivebus.Description]
    state: str | None = None
    fault: str | None = None
    doubtful: Mapping[str, str] = field(default_factory=dict)
    hint: str = ""
    now: Mapping[str | int, Any] | None = None
    least: dict[str, Any] = field(default_factory=dict)
    greatest: dict[str, Any] = field(default_factory=dict)
    missing: str = ""

    def take(self, sample: drivebus.Sample) -> None:
        """Takes the newest sample."""
        self.missing = "" if sample.missing is None else str(sample.missing)
        self.now = None if sample.missing is not None else dict(sample)
        for name in self.rows if self.now is not None else ():
            value = sample[name]
            self.least[name] = min(value, self.least.get(name, value))
            self.greatest[name] = max(value, self.greatest.get(name, value))

    def doing(self) -> Text:
        """State and fault, as far as they are told."""
        if self.now is None:
            return Text("no answer" if self.missing else "waiting", "yellow")
        told = Text()
        if self.state is not None and self.state in self.now:
            state = self.profile.state(int(self.now[self.state]))
            told.append(state.replace("_", " "), _STYLES.get(state, ""))
        word = int(self.now[self.fault]) if self.fault is not None and self.fault in self.now else 0
        code = self.profile.fault_number(word)
        if code:
            told.append(f"{', ' if told else ''}{printable(str(self.profile.fault(code)))}", "bold red")
        return told


class Screen:
    """What is shown, as it is now: renders itself to whatever size the terminal has.

    Args:
        drives: Whom it shows, each under its name.
    """

    def __init__(self, drives: Sequence[Watched]) -> None:
        self._drives = drives
        self._names = list(dict.fromkeys(name for drive in drives for name in drive.rows))
        self._times: deque[float] = deque(maxlen=_RATED)
        self._began: float | None = None

    def take(self, time: float) -> None:
        """A sample came that was asked for at *time*."""
        self._began = time if self._began is None else self._began
        self._times.append(time)

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width, height = options.max_width, options.height or console.height
        heads, notes = self._heads(width), self._notes()
        used = sum(len(line.wrap(console, width)) for line in [*heads, *notes])
        room = height - used - 1  # the line of the columns' names
        names, blocks, extremes = self._fitting(width, room)
        lacking = len(self._names) - len(names)
        if lacking:
            names = names[:-1]  # its place is taken by what is said of the others
            notes.append(Text(f"{lacking + 1} more do not fit: name those you want, or make the window larger", "dim"))
        above, below = ([part for line in lines for part in line.wrap(console, width)] for lines in (heads, notes))
        yield Group(*above, self._table(names, blocks, extremes), *below)

    def _heads(self, width: int) -> list[Text]:
        """Who is watched, and how often and how long, if a line of *width* has room for that."""
        span = self._times[-1] - self._times[0] if self._times else 0.0
        rate = f"{(len(self._times) - 1) / span:.1f}/s" if span else ""
        took = int(self._times[-1] - (self._began or 0.0)) if self._times else 0
        when = f"{took // 3600}:{took // 60 % 60:02}:{took % 60:02}"
        heads = []
        for drive in self._drives:
            head = Text(printable(drive.what), "bold")
            doing = drive.doing()
            heads.append(head if not doing.plain else head.append("  ").append_text(doing))
        for each in (when, rate):
            if each and heads[-1].cell_len + 2 + len(each) <= width:
                heads[-1].append(f"  {each}", "dim")
        return heads

    def _notes(self) -> list[Text]:
        """What is missing, and why; and what the marks mean."""
        named = len(self._drives) > 1
        notes = [
            Text(printable(f"{drive.name + ': ' if named else ''}missing: {drive.missing}"), "yellow")
            for drive in self._drives
            if drive.missing
        ]
        notes += [Text(text, "dim") for text in dict.fromkeys(drive.hint for drive in self._drives) if text]
        meant = meaning(doubt for drive in self._drives for doubt in drive.doubtful.values())
        if meant:
            notes.append(Text(f"{meant}: `drivebus describe NAME` says why", "dim"))
        return notes

    def _fitting(self, width: int, room: int) -> tuple[list[str], int, bool]:
        """What fits: the names, in how many blocks, and whether with least and greatest."""
        most: tuple[list[str], int, bool] = ([], 1, False)
        for extremes in (True, False):
            for blocks in range(1, 9):
                if blocks * self._width(extremes) + (blocks - 1) * _BETWEEN > width:
                    break
                names = self._names[: max(room, 1) * blocks]
                if len(names) == len(self._names):
                    return names, blocks, extremes
                most = max(most, (names, blocks, extremes), key=lambda fit: len(fit[0]))
        return most if most[0] else (self._names[: max(room, 1)], 1, False)

    def _width(self, extremes: bool) -> int:
        columns = self._columns(extremes)
        cells = [self._cells(name, extremes) for name in self._names]
        widths = [max([len(title), *(len(row[at]) for row in cells)]) for at, title in enumerate(columns)]
        return sum(widths) + 2 * (len(widths) - 1)

    def _table(self, names: Sequence[str], blocks: int, extremes: bool) -> Table:
        """*names* in *blocks* beside each other."""
        all_of_them = Table.grid(padding=(0, _BETWEEN))
        each = -(-len(names) // blocks)
        parts = [names[at : at + each] for at in range(0, len(names), each)] if each else []
        tables = []
        for part in parts:
            table = Table(box=None, header_style="bold", pad_edge=False, padding=(0, 2, 0, 0))
            for at, title in enumerate(self._columns(extremes)):
                numeric = 0 < at < len(self._columns(extremes)) - 2
                table.add_column(title, justify="right" if numeric else "left", no_wrap=True)
            for name in part:
                table.add_row(*map(Text, self._cells(name, extremes)))
            tables.append(table)
        all_of_them.add_row(*tables)
        return all_of_them

    def _columns(self, extremes: bool) -> list[str]:
        if len(self._drives) > 1:
            return ["register", *(drive.name for drive in self._drives), "unit", ""]
        return ["register", "value", *(("least", "greatest") if extremes else ()), "unit", ""]

    def _cells(self, name: str, extremes: bool) -> list[str]:
        """One row: the name, its values, its unit, and what is to be known of it."""
        of_one = len(self._drives) == 1
        having = [drive for drive in self._drives if name in drive.rows]
        units = {drive.rows[name].unit for drive in having}
        unit = units.pop() if len(units) == 1 else None
        values = []
        for drive in self._drives:
            value = _text(drive, drive.now, name)
            # What holds for one drive only stands behind its value.
            if value and unit is None:
                value += f" {drive.rows[name].unit}"
            values.append(value if of_one or not value else f"{value}{_mark(drive, name)}")
        if of_one and extremes:
            values += [_text(having[0], extreme, name) for extreme in (having[0].least, having[0].greatest)]
        mark = _mark(having[0], name) if of_one else ""
        return [printable(text) for text in (name, *values, unit or "", mark)]


def meaning(doubts: Iterable[str]) -> str:
    """What the marks of *doubts* mean; empty without any."""
    there = set(doubts)
    return ", ".join(f"{mark} {doubt}" for doubt, mark in MARKS.items() if doubt in there)


def _mark(drive: Watched, name: str) -> str:
    """What stands behind a value that is not proved."""
    return MARKS.get(drive.doubtful.get(name, ""), "")


def _text(drive: Watched, values: Mapping[Any, Any] | None, name: str) -> str:
    """The value of *name* as people read it; nothing where there is none."""
    if values is None or name not in drive.rows or name not in values:
        return ""
    return drive.rows[name].text(values[name])
