"""The overview: a line for each drive, and a cursor that says which of them the keys are for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual.binding import Binding, BindingType
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from drivebus.cli.panel import render
from drivebus.cli.panel.members import Member
from drivebus.cli.present.output import printable

__all__ = ["Overview", "summary"]

_COLUMNS = [("output_current", "A"), ("bus_voltage", "bus V"), ("output_torque", "torque"), ("output_voltage", "out V")]
"""What is shown beside frequency and setpoint where there is room, and under which title."""
_NUMBER, _TREND, _STATE = 8, 20, 40
"""Columns of a number, of a trend, and of the state at least."""


class Overview(ScrollView, can_focus=True):
    """The lines of all drives. Draws those that changed, and only those.

    Args:
        members: The drives.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "move(-1)"),
        Binding("down", "move(1)"),
        Binding("pageup", "move(-10)"),
        Binding("pagedown", "move(10)"),
        Binding("home", "move(-1000)"),
        Binding("end", "move(1000)"),
        Binding("enter,right", "choose"),
    ]

    class Moved(Message):
        """The cursor is on *member* now."""

        def __init__(self, member: Member) -> None:
            super().__init__()
            self.member = member

    class Chosen(Message):
        """One drive is to be looked at."""

        def __init__(self, member: Member) -> None:
            super().__init__()
            self.member = member

    def __init__(self, members: Sequence[Member]) -> None:
        super().__init__()
        self._members = members
        self._at = 0
        self._lines = [Text("")] * len(members)

    def on_mount(self) -> None:
        """Makes room for a line each, and one for the titles."""
        self.virtual_size = Size(0, len(self._members) + 1)

    def on_resize(self) -> None:
        """Draws all of it anew."""
        self.show(all_of_them=True)

    def show(self, all_of_them: bool = False) -> None:
        """Draws the lines that changed, or *all_of_them*."""
        for place, member in enumerate(self._members):
            line = self._line(member)
            if line != self._lines[place]:
                self._lines[place] = line
                self._draw(place)
        if all_of_them:
            self.refresh()

    def render_line(self, y: int) -> Strip:
        """One line of what is visible: the titles stay above."""
        width = self.size.width
        place = y - 1 + self.scroll_offset.y
        if y == 0:
            line = self._titles()
        elif place < len(self._members):
            line = self._lines[place].copy()
        else:
            line = Text("")
        line.truncate(width, overflow="ellipsis", pad=True)
        if y and place == self._at:
            line.stylize("reverse")
        return Strip(line.render(self.app.console), width)

    def action_move(self, by: int) -> None:
        """Moves the cursor."""
        before, self._at = self._at, min(max(self._at + by, 0), len(self._members) - 1)
        visible = self.size.height - 1
        top = min(max(self.scroll_offset.y, self._at - visible + 1), self._at)
        self.scroll_to(y=top, animate=False)
        self._draw(before)
        self._draw(self._at)
        self.post_message(self.Moved(self._members[self._at]))

    def action_choose(self) -> None:
        """Looks at the drive under the cursor."""
        self.post_message(self.Chosen(self._members[self._at]))

    def _draw(self, place: int) -> None:
        y = place + 1 - self.scroll_offset.y
        if 1 <= y < self.size.height:
            self.refresh(Region(0, y, self.size.width, 1))

    def _fitting(self) -> tuple[int, list[tuple[str, str]], bool]:
        """How wide the names are, which columns fit, and whether trends do."""
        width = self.size.width
        named = min(max(len(printable(member.called)) for member in self._members) + 2, 24)
        room = width - named - 2 * _NUMBER - _STATE
        count = min(max(room // _NUMBER, 0), len(_COLUMNS))
        return named, _COLUMNS[:count], room - count * _NUMBER >= _TREND + 2

    def _titles(self) -> Text:
        named, columns, trends = self._fitting()
        shown = f"{'drive':<{named}}{'Hz':>{_NUMBER}}{'set Hz':>{_NUMBER}}"
        shown += "".join(f"{title:>{_NUMBER}}" for _, title in columns)
        shown += f"  {'trend':<{_TREND}}" if trends else ""
        return Text(f"{shown}  state", "bold")

    def _line(self, member: Member) -> Text:
        named, columns, trends = self._fitting()
        line = Text(f"{printable(member.called):<{named}.{named}}", "bold" if member.motor.started else "")
        roles = [member.role(role) for role in ("frequency", "setpoint")]
        for name in [*roles, *(name for name, _ in columns)]:
            shown = "" if name is None else render.value(member, name)
            line.append(f"{shown:>{_NUMBER}}")
        if trends:
            drawn = render.scaled(member, roles[0], _TREND) if roles[0] is not None else Text("")
            drawn.pad_right(_TREND - drawn.cell_len)
            line.append("  ").append_text(drawn)
        line.append("  ").append_text(render.state(member))
        return line


def summary(members: Sequence[Member]) -> Text:
    """How many drives there are, and how many of them do what."""
    turning = sum(render.turns(member) for member in members)
    started = sum(member.motor.started for member in members)
    silent = sum(member.is_silent for member in members)
    tripped = sum(render.tripped(member) for member in members)
    told = Text(f"{len(members)} drives", "bold")
    for count, what, style in (
        (turning, "running", "green"),
        (started, "started by this panel", "bold green"),
        (tripped, "in fault", "bold red"),
        (silent, "silent", "yellow"),
    ):
        if count:
            told.append(f", {count} {what}", style)
    meant = render.marks(*members)
    return told.append(f"  {meant}", "dim") if meant else told
