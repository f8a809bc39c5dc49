"""The screens one looks at: the overview of several drives, and the view of one."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import ClassVar

from rich.console import RenderableType
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.screen import Screen
from textual.widgets import Static

from drivebus.cli.panel import render
from drivebus.cli.panel.journal import Journal
from drivebus.cli.panel.members import Member
from drivebus.cli.panel.overview import Overview, summary

__all__ = ["DriveView", "Fleet", "Piece", "View"]

_KEYS = "Space STOP  r run  s stop  j jog  f set Hz  {next}  p params  ? help  q quit"
_FAULT, _PREPARE = "x reset", "b prepare"
"""The keys that the last line names. In one of its places stands what helps now: not all have room in 80 columns."""

_TILE = 19
"""Columns of a big value: six figures and a point."""
_MOST_TILES = 6
_TILE_HEIGHT = 6
"""Lines of a big value with a trend of one line."""
_LARGE, _TALLEST = 34, 12
"""Lines of a window in which all values have room, and lines more that a trend takes at most."""
_MESSAGES = 3
"""Lines of messages."""
_MORE = " … m: all"
_ROOMY = 30
"""Lines of a window in which a fault, with its cause and remedy, leaves the values their room."""
_TIGHT = "tight"
"""The class of a screen that has less."""


class Piece(Static):
    """A part of a screen that is drawn when what it shows has changed, and only then."""

    def __init__(self, name: str) -> None:
        super().__init__(id=name)
        self._shown: Hashable = None

    def put(self, content: RenderableType, key: Hashable = None) -> None:
        """Shows *content*; *key* tells whether it has changed, where the content itself cannot.

        What has a key always takes the same room.
        """
        told = key if key is not None else str(content) + repr(getattr(content, "spans", ""))
        if told != self._shown:
            self._shown = told
            self.update(content, layout=key is None)


class View(Screen[None]):
    """What every view has: the latest messages, and the keys.

    Args:
        journal: Where the messages come from.

    Attributes:
        is_ready: Whether its parts are there: before that nothing can be shown.
    """

    def __init__(self, journal: Journal) -> None:
        super().__init__()
        self._journal = journal
        self.is_ready = False

    def on_mount(self) -> None:
        """Its parts are there."""
        self.is_ready = True
        self.call_after_refresh(self.show)

    def foot(self) -> ComposeResult:
        """The last lines of the screen."""
        with Vertical(id="foot"):
            yield Piece("messages")
            yield Piece("keys")

    def show(self) -> None:
        """Shows what is known now."""
        self.query_one("#messages", Piece).put(self._messages())
        self.query_one("#keys", Piece).put(_keys(render.tripped(self.shown())))

    def shown(self) -> Member:
        """The drive that the keys are for."""
        raise NotImplementedError

    def _messages(self) -> Text:
        """The newest message in full, as far as there is room, and those before it."""
        width = max(self.size.width, 1)
        shown: list[Text] = []
        most = _MESSAGES - self.has_class(_TIGHT)
        for line in reversed(self._journal.lines()[-most:]):
            text = Text(f"{line.when:%H:%M:%S} ", "dim").append(line.text, line.style)
            lines = list(text.wrap(self.app.console, width))
            room = most - len(shown)
            if len(lines) > room and shown:
                break
            if len(lines) > room:
                lines = lines[:room]
                lines[-1].truncate(width - len(_MORE))
                lines[-1].append(_MORE, "dim")
            shown = [*lines, *shown]
        return Text("\n").join(shown)

    def on_resize(self) -> None:
        """Lays it out anew."""
        if self.is_ready:
            self.call_after_refresh(self.show)


class Fleet(View):
    """The overview.

    Args:
        members: The drives.
        current: Tells which of them the cursor is on.
        journal: Where the messages come from.
    """

    def __init__(self, members: Sequence[Member], current: Callable[[], Member], journal: Journal) -> None:
        super().__init__(journal)
        self._members = members
        self._current = current

    def shown(self) -> Member:
        """The one under the cursor."""
        return self._current()

    def compose(self) -> ComposeResult:
        """How many they are, a line each, what there is to say of the one under the cursor, and the foot."""
        yield Piece("head")
        yield Overview(self._members)
        yield Piece("chosen")
        yield from self.foot()

    def show(self) -> None:
        """Shows what is known now."""
        self.query_one("#head", Piece).put(summary(self._members))
        self.query_one(Overview).show()
        member = self._current()
        told = render.head(member).append("  ").append_text(render.doing(member))
        more = render.fault(member)
        self.query_one("#chosen", Piece).put(told.append("\n").append_text(more) if more else told)
        super().show()


class DriveView(View):
    """One drive: big values, the others, lamps, fault, line.

    Args:
        member: The drive.
        members: All drives: the arrow keys go to the next.
        journal: Where the messages come from.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "app.leave_view", "back"),
        Binding("left,up", "app.next(-1)", "previous drive"),
        Binding("right,down", "app.next(1)", "next drive"),
        Binding("pageup", "page(-1)", "previous values"),
        Binding("pagedown", "page(1)", "next values"),
    ]

    def __init__(self, member: Member, members: Sequence[Member], journal: Journal) -> None:
        super().__init__(journal)
        self.member = member
        self._members = members
        self._page = 0

    def shown(self) -> Member:
        """The one in view."""
        return self.member

    def turn_to(self, member: Member) -> None:
        """Shows another drive."""
        self.member = member
        self._page = 0
        self.show()

    def action_page(self, by: int) -> None:
        """Shows other values."""
        self._page += by
        self.show()

    def compose(self) -> ComposeResult:
        """All parts, from the top."""
        yield Piece("head")
        yield Piece("doing")
        with Horizontal(id="tiles"):
            for place in range(_MOST_TILES):
                yield Piece(f"tile{place}")
        yield Piece("values")
        for name in ("lamps", "fault", "line"):
            yield Piece(name)
        yield from self.foot()

    def show(self) -> None:
        """Shows what is known now."""
        member = self.member
        head = render.head(member)
        if len(self._members) > 1:
            head.append(f"  {self._members.index(member) + 1} of {len(self._members)}", "dim")
        if meant := render.marks(member):
            head.append(f"  {meant}", "dim")
        self.query_one("#head", Piece).put(head)
        self.query_one("#doing", Piece).put(render.doing(member))
        names = render.tiles(member, min(max(self.size.width // (_TILE + 1), 1), _MOST_TILES))
        self._show_tiles(names)
        values = self.query_one("#values", Piece)
        values.put(render.values(member, names, values.size.width, values.size.height, self._page))
        self.query_one("#lamps", Piece).put(Text("\n").join(render.lamps(member)))
        fault = self.query_one("#fault", Piece)
        told = render.fault(member)
        self.set_class(bool(told) and self.size.height < _ROOMY, _TIGHT)
        fault.display = bool(told)
        fault.put(told)
        self.query_one("#line", Piece).put(render.line(member))
        super().show()

    def _show_tiles(self, names: Sequence[str]) -> None:
        # What a large window has left over, trends take.
        tall = min(max(self.size.height - _LARGE, 0), _TALLEST) + 1
        tiles = self.query_one("#tiles", Horizontal)
        tiles.styles.height = _TILE_HEIGHT + tall - 1
        for place in range(_MOST_TILES):
            tile = self.query_one(f"#tile{place}", Piece)
            tile.styles.height = _TILE_HEIGHT + tall - 1
            tile.display = place < len(names)
            if place >= len(names):
                continue
            name, width = names[place], max(tile.size.width - 1, 1)
            drawn = render.scaled(self.member, name, width, tall).plain
            key = (name, render.value(self.member, name), drawn, self.member.highest)
            tile.put(render.big(self.member, name, width, tall), key)


def _keys(is_tripped: bool) -> Text:
    """The last line."""
    keys = Text()
    for named in _KEYS.format(next=_FAULT if is_tripped else _PREPARE).split("  "):
        key, _, meaning = named.partition(" ")
        keys.append("  " if keys else "").append(key, "bold red" if meaning == "STOP" else "bold").append(f" {meaning}")
    return keys
