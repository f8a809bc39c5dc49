"""What reaches a terminal: results as tables for people or one JSON object a line for programs, and remarks.

Text comes from anywhere: from folders, profiles, adapters and drives. Everything goes out through here, and what a
terminal would obey comes out as letters. rich and click were looked at for that: rich takes away a few characters and
lets ESC pass, click takes away the sequences it knows, and only where there is no terminal.
"""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import click

import drivebus

# rich is loaded when something is laid out: a stop is on the wire before that.
if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

__all__ = ["Output", "Result", "about", "counted", "laid_out", "plain", "printable", "remark", "show"]

_PIPE_WIDTH = 200
"""Characters a line may have where no terminal limits it: nothing is cut."""

_NUMBER = r"-?\d+(\.\d+)?"

_BETWEEN = 2
"""Blanks between two columns of a table."""


class Result(Protocol):
    """What a command found: the same for a program and for people. A command makes one, and shows nothing itself."""

    def records(self) -> Iterable[Mapping[str, Any]]:
        """Its objects for a program, one a line."""

    def lay_out(self, out: Output) -> None:
        """Shows people what it says, on *out*."""


class Output:
    """Where results go.

    Attributes:
        as_json: One object a line and no decoration.
    """

    def __init__(self, as_json: bool) -> None:
        self.as_json = as_json
        self._held: io.StringIO | None = None
        self._drive = ""

    @property
    def drive(self) -> str:
        """Whose results these are, where there are several drives; empty for one alone."""
        return self._drive

    def held(self, drive: str) -> Output:
        """One for *drive* that keeps what it is given until it may `let_go`: several are filled at once."""
        other = Output(self.as_json)
        other._held, other._drive = io.StringIO(), drive
        return other

    def let_go(self) -> None:
        """Shows what was kept: what has several lines, under its drive."""
        held = "" if self._held is None else self._held.getvalue()
        title = f"{printable(self._drive)}\n" if len(held.splitlines()) > 1 and not self.as_json else ""
        print(f"{title}{held}", end="\n" if title else "", flush=True)

    @cached_property
    def console(self) -> Console:
        """Where people read."""
        from rich.console import Console

        if self._held is None:
            console = Console(highlight=False, soft_wrap=True)
        else:
            console = Console(highlight=False, soft_wrap=True, file=self._held, force_terminal=sys.stdout.isatty())
        if not console.is_terminal:
            console.width = _PIPE_WIDTH
        return console

    @property
    def live(self) -> bool:
        """Whether a person watches: a terminal, and no JSON."""
        return not self.as_json and self._held is None and self.console.is_terminal

    def render(self, result: Result) -> None:
        """Shows *result*, to whom it is for."""
        if not self.as_json:
            result.lay_out(self)
            return
        for values in result.records():
            self.record(values)

    def preview(self, result: Result) -> None:
        """Shows people what *result* is before it is settled; nothing in JSON."""
        if not self.as_json:
            result.lay_out(self)

    def remark(self, text: str) -> None:
        """A line on standard error for people; nothing in JSON."""
        if not self.as_json:
            remark(text)

    def record(self, values: Mapping[str, Any]) -> None:
        """One JSON object; nothing for people."""
        if not self.as_json:
            return
        import json

        told = {"drive": self._drive} if self._drive else {}
        told |= {key: plain(value) for key, value in values.items()}
        text = json.dumps(told, ensure_ascii=not _takes_everything(sys.stdout.encoding))
        # Of what a terminal obeys, JSON has to escape the least part.
        print(_replaced(text, lambda letter: json.dumps(letter)[1:-1]), file=self._held, flush=True)

    def say(self, text: str, first: str = "", hanging: int = 0) -> None:
        """A line for people; nothing in JSON.

        Args:
            text: The line. On a terminal it is broken between words.
            first: The style of its first word.
            hanging: Columns by which the lines behind the first are moved in.
        """
        if self.as_json:
            return
        shown = printable(text)
        if self.console.is_terminal:
            shown = wrapped(shown, self.console.width, hanging)
        word = len(shown) - len(shown.lstrip()) + len((shown.split() or [""])[0])
        line = show_plainly(shown, first, word) if first else shown
        self.console.print(line, markup=False)

    def heading(self, text: str) -> None:
        """A line above a section; nothing in JSON."""
        if not self.as_json:
            self.console.print(f"\n{printable(text)}", style="bold", markup=False)

    def facts(self, values: Mapping[str, Any]) -> None:
        """Names and values: a JSON object, or two columns."""
        if self.as_json:
            self.record(values)
            return
        from rich.table import Table

        table = Table.grid(padding=(0, 2))
        for name, value in values.items():
            if value is not None and value != "":
                table.add_row(show(name.replace("_", " ")), show(value))
        self._lay_out(table)

    def rows(self, columns: Sequence[str], rows: Iterable[Sequence[Any]], spare: Sequence[str] = ()) -> None:
        """Several things of one kind: a JSON object each, or a table.

        Args:
            columns: Their names.
            rows: A value for each column.
            spare: Columns that a narrow terminal goes without, the first to go first.
        """
        if self.as_json:
            for row in rows:
                self.record(dict(zip(columns, row, strict=True)))
            return
        kept = list(rows)
        if spare and self.console.is_terminal:
            columns, kept = _fitting(columns, kept, spare, self.console.width)
        table = self.table(columns, kept)
        # A name that is cut cannot be typed, and a word broken in the middle not be read.
        room = self.console.width - _BETWEEN * (len(columns) - 1)
        widths = _widths([[name, *(row[place] for row in kept)] for place, name in enumerate(columns)], room)
        for column, width in zip(table.columns, widths, strict=True):
            column.width = width
        if kept and sum(widths) > room:
            for row in kept:
                self.console.print()
                self.facts(dict(zip(columns, row, strict=True)))
            return
        self._lay_out(table)

    def _lay_out(self, table: Table) -> None:
        """Shows *table*, in a file or a pipe without the blanks that fill its last column."""
        if self.console.is_terminal:
            self.console.print(table)
            return
        with self.console.capture() as laid_out:
            self.console.print(table)
        for line in laid_out.get().splitlines():
            self.console.print(line.rstrip(), markup=False)

    @staticmethod
    def table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> Table:
        """A table for people, numbers to the right."""
        from rich.table import Table

        kept = [list(row) for row in rows]
        table = Table(box=None, header_style="bold", pad_edge=False)
        for index, name in enumerate(columns):
            numeric = bool(kept) and all(_is_number(row[index]) for row in kept)
            title = name.replace("_", " ")
            table.add_column(title, justify="right" if numeric else "left", overflow="fold")
        for row in kept:
            table.add_row(*(show(cell) for cell in row))
        return table


def _fitting(
    columns: Sequence[str], rows: Sequence[Sequence[Any]], spare: Sequence[str], width: int
) -> tuple[Sequence[str], list[Sequence[Any]]]:
    """*columns* and *rows* without as many of the *spare* columns as it takes for each row to have one line."""
    names, kept = list(columns), [list(row) for row in rows]
    for name in spare:
        room = width - _BETWEEN * (len(names) - 1)
        if sum(_widths([[title, *(row[at] for row in kept)] for at, title in enumerate(names)], sys.maxsize)) <= room:
            break
        at = names.index(name)
        del names[at]
        for row in kept:
            del row[at]
    return names, list(kept)


def _widths(columns: Sequence[Sequence[Any]], room: int) -> list[int]:
    """The width of each of *columns*, their titles first, so that they share *room* and no word is broken.

    rich makes every column narrower that may be, and breaks words for it. More than *room*, where that is too small.
    """
    from rich.cells import cell_len
    from rich.text import Text

    cells = [[Text.from_markup(show(cell)).plain for cell in column] for column in columns]
    least = [max(cell_len(word) for cell in column for word in (cell.split() or [""])) for column in cells]
    widths = [max(cell_len(line) for cell in column for line in (cell.splitlines() or [""])) for column in cells]
    while sum(widths) > max(room, sum(least)):
        spare = [width - needed for width, needed in zip(widths, least, strict=True)]
        widths[spare.index(max(spare))] -= 1
    return widths


def _is_number(cell: Any) -> bool:
    """Whether *cell* is a number, or shows one."""
    if isinstance(cell, drivebus.Choice):
        return False
    return isinstance(cell, (int, float)) or (isinstance(cell, str) and re.fullmatch(_NUMBER, cell) is not None)


def _takes_everything(encoding: str | None) -> bool:
    """Whether text of any alphabet can be written in *encoding*."""
    return encoding is None or encoding.lower().replace("_", "-").startswith("utf")


def plain(value: Any) -> Any:
    """*value* as JSON knows it; a choice becomes its number and its label."""
    if isinstance(value, drivebus.Choice):
        return {"value": int(value), "label": value.label}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    if isinstance(value, drivebus.Fault):
        return {"code": value.code, "mnemonic": value.mnemonic, "label": value.label}
    return value


def show(value: Any) -> str:
    """*value* for people. Text with brackets in it is no markup."""
    from rich.markup import escape

    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, drivebus.Choice):
        return escape(printable(f"{int(value)} = {value.label}"))
    if isinstance(value, bytes):
        return value.hex(" ").upper()
    text = escape(printable(str(value)))
    style = _style(value)
    return f"[{style}]{text}[/]" if style else text


def _style(value: Any) -> str:
    """How *value* is shown where there are colours."""
    if isinstance(value, drivebus.Fault) or value is drivebus.State.FAULT:
        return "bold red"
    return "green" if isinstance(value, drivebus.State) and value.running else ""


def show_plainly(text: str, style: str, count: int) -> Text:
    """*text* as it is, the first *count* letters in *style*."""
    from rich.text import Text

    shown = Text(text)
    shown.stylize(style, 0, count)
    return shown


def wrapped(text: str, width: int, hanging: int = 0) -> str:
    """*text* broken between words so that its lines have at most *width* columns.

    A word that is longer stays whole, and so does a command in backticks: whoever copies it gets all of it.
    """
    from textwrap import TextWrapper

    lines = []
    for line in text.split("\n"):
        kept = re.sub(_COMMAND, lambda command: command[0].replace(" ", _NO_BREAK), line)
        indent = " " * (len(line) - len(line.lstrip()) + hanging)
        wrapper = TextWrapper(width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
        wrapper.drop_whitespace = True
        wrapper.expand_tabs = wrapper.replace_whitespace = False
        lines += wrapper.wrap(kept) or [""]
    return "\n".join(lines).replace(_NO_BREAK, " ")


_COMMAND = "`[^`]*`"
_NO_BREAK = "\x00"
"""Stands for a blank at which no line ends; no text that is shown has it."""


def printable(text: str) -> str:
    """*text* without what would do something to a terminal; each such letter as Python writes it."""
    return _replaced(text, lambda letter: letter if letter == "\n" else repr(letter)[1:-1])


@contextmanager
def about(drive: str) -> Iterator[None]:
    """A block whose remarks begin with *drive*: it is one of several that a command is done for."""
    token = _ABOUT.set(f"{drive}: ")
    try:
        yield
    finally:
        _ABOUT.reset(token)


_ABOUT: ContextVar[str] = ContextVar("about", default="")


def remark(text: str = "") -> None:
    """A line on standard error: what is no result. On a terminal it is broken between words."""
    shown = laid_out(printable(f"{_ABOUT.get()}{text}"))
    if _is_terminal(sys.stderr):
        for word, colour in (("Error:", "red"), ("Warning:", "yellow")):
            if _is_coloured() and word in shown[: len(_ABOUT.get()) + len(word)]:
                shown = shown.replace(word, click.style(word, fg=colour, bold=True), 1)
    click.echo(shown, err=True)


def counted(count: int, what: str) -> str:
    """How many there are of *what*, in words: `1 unit`, `2 units`."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def laid_out(text: str) -> str:
    """*text* for standard error: on a terminal, broken between words."""
    if not _is_terminal(sys.stderr):
        return text
    from shutil import get_terminal_size

    return wrapped(text, get_terminal_size().columns)


def _is_terminal(stream: Any) -> bool:
    # Who closed it has none at all.
    return stream is not None and bool(stream.isatty())


def _is_coloured() -> bool:
    """As rich decides it of standard output: https://no-color.org, and a terminal that knows no colours."""
    return not os.environ.get("NO_COLOR") and os.environ.get("TERM", "") not in ("dumb", "unknown")


def _replaced(text: str, shown: Callable[[str], str]) -> str:
    """*text* with what is not printable as *shown* says."""
    return text if text.isprintable() else "".join(each if each.isprintable() else shown(each) for each in text)
