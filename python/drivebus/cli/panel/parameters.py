"""The parameters of one drive: by group or by search, with value, unit, range and meaning; changed, and compared.

Values are read in a thread, group by group, as they are looked at.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import partial
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.widgets import DataTable

import drivebus
from drivebus.cli.names import evidence
from drivebus.cli.panel.dialogs import Ask, AskFor, Show
from drivebus.cli.panel.journal import Journal
from drivebus.cli.panel.line_field import LineField
from drivebus.cli.panel.members import Member
from drivebus.cli.panel.view import Piece
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.output import printable

__all__ = ["Parameters"]

_MATCHES = 60
"""Most rows that a search shows."""


class Parameters(Screen[None]):
    """The parameters.

    Args:
        member: The drive's line in the panel.
        drive: The drive.
        journal: Who is told what came of it.
    """

    AUTO_FOCUS = "DataTable"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "leave", "back"),
        Binding("slash", "search", "search"),
        Binding("left", "group(-1)", "previous group"),
        Binding("right", "group(1)", "next group"),
        Binding("u", "read", "read again"),
        Binding("d", "compare", "compare with a backup"),
    ]

    def __init__(self, member: Member, drive: drivebus.Drive, journal: Journal) -> None:
        super().__init__()
        self._member = member
        self._drive = drive
        self._journal = journal
        self._rows = _parameters(drive.profile)
        self._groups = list(dict.fromkeys(row.group for row in self._rows)) or [""]
        self._at = 0
        self._shown: list[drivebus.Description] = []
        self._values: dict[str, str] = {}
        self._turn = 0

    def compose(self) -> ComposeResult:
        """The title, the search, the rows, and what is known of the one under the cursor."""
        yield Piece("head")
        yield LineField(hint="/ searches names, meanings and notes", name="search")
        yield DataTable(cursor_type="row")
        yield Piece("detail")
        yield Piece("keys")

    def on_mount(self) -> None:
        """Shows the first group."""
        table = self._table()
        for title in ("code", "value", "unit", "label"):
            table.add_column(title, key=title)
        self.query_one("#keys", Piece).put(_keys())
        self._show_group()

    def _table(self) -> DataTable[Text]:
        table: DataTable[Text] = self.query_one(DataTable)
        return table

    def action_leave(self) -> None:
        """Goes back, or out of the search."""
        if self.query_one(LineField).has_focus:
            self._table().focus()
        else:
            self._turn += 1
            self.dismiss()

    def action_search(self) -> None:
        """Begins to search."""
        self.query_one(LineField).focus()

    def action_group(self, by: int) -> None:
        """Shows the next group."""
        self._at = (self._at + by) % len(self._groups)
        self._show_group()

    def action_read(self) -> None:
        """Reads what is shown once more."""
        for row in self._shown:
            self._values.pop(_key(row), None)
        self._fill(self._shown, self._title)

    def on_line_field_changed(self, event: LineField.Changed) -> None:
        """Shows what fits the words so far."""
        wanted = event.value.strip()
        if not wanted:
            self._show_group()
            return
        known = {_key(row): row for row in self._rows} | {row.name: row for row in self._rows}
        found = [known[name] for name in self._drive.profile.search(wanted, _MATCHES) if name in known]
        found += [row for row in self._rows if _key(row).lower().startswith(wanted.lower()) and row not in found]
        self._fill(found[:_MATCHES], f'"{wanted}": {len(found)} found')

    def on_line_field_submitted(self) -> None:
        """Goes to the rows."""
        self._table().focus()

    def _show_group(self) -> None:
        group = self._groups[self._at]
        rows = [row for row in self._rows if row.group == group]
        self._fill(rows, f"group {group}, {self._at + 1} of {len(self._groups)}")

    def _fill(self, rows: Sequence[drivebus.Description], title: str) -> None:
        """Shows *rows*, and reads those that were not read yet."""
        self._title = title
        self._shown = list(rows)
        self._turn += 1
        self.query_one("#head", Piece).put(_title(f"parameters, {title}: {self._member.what}"))
        table = self._table()
        table.clear()
        for row in rows:
            shown = self._values.get(_key(row), "…")
            cells = (_key(row), f"{shown:.28}", row.unit, f"{row.label:.60}")
            table.add_row(*(Text(printable(cell)) for cell in cells), key=_key(row))
        wanted = [row for row in rows if _key(row) not in self._values]
        if wanted:
            # A view that was left has no app any more, and its thread may still be at work.
            look = partial(self._read, self.app, wanted, self._turn)
            threading.Thread(target=look, name="panel parameters", daemon=True).start()
        self._show_detail()

    def _read(self, app: App[object], rows: Sequence[drivebus.Description], turn: int) -> None:
        """Reads *rows*, as long as they are looked at. In a thread of its own."""
        for row in rows:
            if turn != self._turn:
                return
            try:
                shown = row.text(self._drive.read(_key(row)))
            except (drivebus.NotAllowed, drivebus.Refused) as error:
                shown = f"not read: {in_commands(error)}"
            except drivebus.DrivebusError as error:
                self._journal.fail(f"{self._member.called}: read {_key(row)}", error)
                shown = f"not read: {in_commands(error)}"
            self._values[_key(row)] = shown
            app.call_later(self._put, _key(row), turn)

    def _put(self, key: str, turn: int) -> None:
        if turn != self._turn or not self.is_attached:
            return
        self._table().update_cell(key, "value", Text(printable(f"{self._values[key]:.28}")), update_width=True)
        chosen = self._chosen()
        if chosen is not None and _key(chosen) == key:
            self._show_detail()

    def _chosen(self) -> drivebus.Description | None:
        at = self._table().cursor_row
        return self._shown[at] if 0 <= at < len(self._shown) else None

    def on_data_table_row_highlighted(self) -> None:
        """Tells what is known of the row under the cursor."""
        self._show_detail()

    def _show_detail(self) -> None:
        row = self._chosen()
        told = Text()
        if row is not None:
            value = self._values.get(_key(row), "…")
            factory = "unknown" if row.default is None else _shown(row, row.default)
            access = _ACCESS.get(row.access, "may or may not be writable")
            known = evidence(self._drive.profile, row)
            told.append(printable(f"{_key(row)} {row.label}: "), "bold").append(printable(f"{value} {row.unit}\n"))
            told.append(printable(f"{_range(row)}; factory {factory}; {access}; {known}\n{row.note}"))
        self.query_one("#detail", Piece).put(told)

    # --- what changes something --------------------------------------------------------------------------------

    def on_data_table_row_selected(self) -> None:
        """Asks for a new value of the row under the cursor."""
        row = self._chosen()
        if row is None:
            return
        value = self._values.get(_key(row), "").partition(" ")[0].removeprefix("…")
        text = f"{self._member.what}: write {_key(row)} ({row.label}), {_range(row)} {row.unit}"
        self.app.push_screen(AskFor(text, "" if value == "not" else value), lambda typed: self._ask(row, typed or ""))

    def _ask(self, row: drivebus.Description, typed: str) -> None:
        if not typed:
            return
        try:
            value: object = int(typed)
        except ValueError:
            try:
                value = float(typed)
            except ValueError:
                value = typed  # the label of a choice
        what = f"write {_key(row)} = {typed} {row.unit}".rstrip()
        text = f"{self._member.what}: {what}. A motor that turns may change its speed. Is the machine clear?"
        answers = {"y": "yes, to RAM: lost with power", "e": "yes, to EEPROM: kept"}

        app, since = self.app, self._member.motor.stops

        def answered(key: str | None) -> None:
            if key:
                self._member.motor.later(what, lambda: self._write(app, row, value, key == "e"), since)

        self.app.push_screen(Ask(text, answers), answered)

    def _write(self, app: App[object], row: drivebus.Description, value: object, store: bool) -> None:
        """Writes, and reads what is there now. In a thread of its own."""
        key = _key(row)
        self._drive.write(key, value, store=store)
        self._values.pop(key, None)
        self._read(app, [row], self._turn)

    def action_compare(self) -> None:
        """Asks for a backup, and shows how the drive differs from it."""
        text = f"{self._member.what}: compare with which backup? A path, or factory for the factory settings"
        self.app.push_screen(AskFor(text, "factory"), self._compare)

    def _compare(self, file: str | None) -> None:
        if file:
            self._journal.say(f"{self._member.called}: compare with {file}")
            threading.Thread(target=self._diff, args=(self.app, file), name="panel diff", daemon=True).start()

    def _diff(self, app: App[object], file: str) -> None:
        """Reads the whole drive. In a thread of its own."""
        try:
            kept = None if file == "factory" else drivebus.Backup.load(file, self._drive.profile)
            found = self._drive.diff(kept)
        except drivebus.DrivebusError as error:
            self._journal.fail(f"{self._member.called}: compare with {file}", error)
            return
        rest = f" {len(found.uncompared)} were not compared." if found.uncompared else ""
        told = Text(printable(f"{file} -> the drive: {len(found)} of {found.compared} parameters differ.{rest}\n\n"))
        told.append("\n".join(printable(str(each)) for each in found))
        app.call_later(app.push_screen, Show(told))


_ACCESS = {"ro": "read-only", "rw": "writable", "run": "writable at any time", "stop": "writable while stopped"}


def _parameters(profile: drivebus.Profile) -> list[drivebus.Description]:
    """The parameters of the family that have an address."""
    rows = [profile.describe(name) for name in profile.names()]
    return [row for row in rows if row.kind == "parameter" and row.address is not None]


def _key(row: drivebus.Description) -> str:
    return row.code or row.name


def _shown(row: drivebus.Description, value: object) -> str:
    return row.text(value) if isinstance(value, (int, float)) else str(value)


def _range(row: drivebus.Description) -> str:
    if row.choices:
        return ", ".join(f"{number} = {label}" for number, label in row.choices.items())
    if row.low is None or row.high is None:
        return "range unknown"
    return f"{row.text(row.low)} to {row.text(row.high)}"


def _title(text: str) -> Text:
    """One line, of which the end may be cut."""
    return Text(printable(text), "bold", no_wrap=True, overflow="ellipsis")


def _keys() -> Text:
    keys = Text()
    for key, meaning in (
        ("Space", "STOP"),
        ("/", "search"),
        ("\u2190 \u2192", "group"),
        ("Enter", "change"),
        ("u", "reread"),
        ("d", "compare"),
        ("Escape", "back"),
    ):
        keys.append("  " if keys else "").append(key, "bold red" if meaning == "STOP" else "bold").append(f" {meaning}")
    return keys
