"""How the panel shows what is known of a drive: big values, trends, lamps, faults and the line, as text with styles.

Nothing here knows a widget or keeps anything. Values, states and faults read as they do in `monitor` and `status`.
"""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text
from textual.renderables.digits import Digits

import drivebus
from drivebus.cli.panel.members import Member
from drivebus.cli.present.motors import going
from drivebus.cli.present.output import printable
from drivebus.cli.present.screen import MARKS, meaning

__all__ = [
    "big",
    "doing",
    "fault",
    "head",
    "lamps",
    "line",
    "marks",
    "named",
    "plain_value",
    "rests",
    "scaled",
    "state",
    "tiles",
    "trend",
    "tripped",
    "turns",
    "value",
    "values",
]

_LEAST_SPAN = 0.1
"""Which part of its greatest value a trend spans at least: a small wobble does not look like a collapse."""
_LEVELS = "▁▂▃▄▅▆▇█"
_ON, _OFF = "●", "○"

_ROLES = ("frequency", "setpoint")
_BESIDE = ("output_current", "bus_voltage", "output_torque", "output_voltage", "rotation_speed", "output_power")
"""What is shown big beside the roles, as far as the family has it, the first the most wanted."""


def tiles(member: Member, count: int) -> list[str]:
    """The registers of *member* that are shown big, *count* at most."""
    if member.watched is None:
        return []
    roles = [name for role in _ROLES if (name := member.role(role)) is not None]
    return [*roles, *(name for name in _BESIDE if name in member.watched.rows)][:count]


def head(member: Member) -> Text:
    """Which drive it is, and where."""
    title = Text(printable(member.watched.what if member.watched is not None else member.what), "bold")
    if member.motor.started:
        title.append("  started by this panel", "bold green")
    return title


def doing(member: Member) -> Text:
    """What it does now: state, frequency and setpoint, and what its status words say beside that."""
    told = Text(_nothing(member), "yellow")
    if member.watched is not None:
        told = _state(member)
    if member.watched is not None and member.watched.now is not None:
        frequencies = [value(member, name) for role in _ROLES if (name := member.role(role)) is not None]
        if frequencies:
            told.append(f"{', ' if told else ''}{' of '.join(frequencies)} Hz")
        told.append_text(_beside(member))
    return told


def state(member: Member) -> Text:
    """State and fault alone, or why there is none."""
    if member.watched is not None and not member.why:
        return _state(member)
    why = f": {member.why}" if member.why else ""
    if member.naming:
        why = f"; Enter: use it as {member.likely}" if member.likely else f"; name it: {member.naming}"
    return Text(printable(f"{_nothing(member)}{why}"), "yellow")


def _state(member: Member) -> Text:
    """State and fault; of one that was stopped here and turns still, that it is stopping."""
    assert member.watched is not None
    state = member.state
    if member.motor.is_slowing and state is not None and (doing := going(state, drivebus.State.STOPPED)):
        return Text(doing, "yellow")
    told = member.watched.doing()
    return told if told.plain else Text("state not told; --unverified may show it", "dim")


def _nothing(member: Member) -> str:
    """Why there is nothing to show, in two words."""
    if member.is_silent:
        return "no port" if isinstance(member.problem, drivebus.PortError) else "no answer"
    return "not known" if member.why else "waiting"


def turns(member: Member) -> bool:
    """Whether its motor turns, as far as it tells."""
    return member.state is not None and member.state.running


def rests(member: Member) -> bool:
    """Whether its motor surely stands, by a value that is fresh."""
    return member.state is not None and not member.why and member.state.at_rest


def tripped(member: Member) -> bool:
    """Whether it is in fault, as far as it tells."""
    watched = member.watched
    if watched is None or watched.now is None:
        return False
    return watched.profile.fault_number(int(watched.now.get(watched.fault or "") or 0)) != 0


def _beside(member: Member) -> Text:
    """What the status words say beside the state, as `status` has it."""
    ready, source = member.told.get("ready"), member.told.get("control_channel")
    told = Text()
    obeys = source in (None, "communication")
    # Ready for its keypad would read as ready for r.
    if ready is not None and (obeys or ready != "ready"):
        told.append(f", {ready.replace('_', ' ')}")
    if source is not None:
        told.append(f", commands from {source}{'' if obeys else ': b prepares it'}", "" if obeys else "yellow")
    if member.told.get("overload_alarm", "none") != "none":
        told.append(", overload pre-alarm", "bold yellow")
    return told


def value(member: Member, name: str) -> str:
    """The newest value of *name* as people read it, with the mark of what is not proved; empty where there is none."""
    watched = member.watched
    if watched is None or watched.now is None or name not in watched.now:
        return ""
    return f"{watched.rows[name].text(watched.now[name])}{_mark(member, name)}"


def _mark(member: Member, name: str) -> str:
    """What stands behind what is not proved."""
    assert member.watched is not None
    return MARKS.get(member.watched.doubtful.get(name, ""), "")


def marks(*members: Member) -> str:
    """What the marks mean that *members* have; empty if they have none."""
    return meaning(doubt for member in members if member.watched for doubt in member.watched.doubtful.values())


def plain_value(member: Member, name: str) -> str:
    """The newest value of *name* without a mark."""
    return value(member, name).rstrip("".join(MARKS.values()))


def named(name: str) -> str:
    """A register as a label."""
    return name.replace("_", " ")


def limits(member: Member, name: str) -> str:
    """Its unit, and up to which value *name* goes on this drive where it tells that: a register may hold far more."""
    assert member.watched is not None
    row = member.watched.rows[name]
    highest = member.highest if name in (member.role("frequency"), member.role("setpoint")) else None
    return row.unit if highest is None else f"{row.unit}, up to {row.text(highest)}"


def big(member: Member, name: str, width: int, height: int = 1) -> RenderableType:
    """One value in big figures, with its name, its unit, its limits and its trend, whose lines are *height*."""
    shown = plain_value(member, name)
    return Group(
        Text(_fitting(named(name) + _mark(member, name), width), "bold"),
        Digits(shown, "bold") if shown else Text("\n\n"),
        Text(_fitting(limits(member, name), width), "dim"),
        scaled(member, name, width, height),
    )


def _fitting(text: str, width: int) -> str:
    """*text*, or as many of its words as a line of *width* holds."""
    while len(text) > width and " " in text:
        text = text.rpartition(" ")[0].rstrip(",")
    return text[:width]


def trend(member: Member, name: str, width: int, height: int = 1) -> Text:
    """The latest values of *name*, the newest to the right: from 0 to the limit, or from the least to the greatest."""
    seen: Sequence[float] = list(member.trends.get(name, ()))[-width:]
    if not seen:
        return Text("")
    low, high = min(seen), max(seen)
    if member.highest and name in (member.role("frequency"), member.role("setpoint")):
        low, high = min(0.0, low), max(member.highest, high)
    span = max(high - low, _LEAST_SPAN * max(abs(low), abs(high))) or 1.0
    # What is wider than what was seen is so to both sides, and does not begin below 0 for that.
    bottom = (low + high - span) / 2
    bottom = max(bottom, 0.0) if low >= 0 else bottom
    full = len(_LEVELS)
    steps = [round((each - bottom) / span * (height * full - 1)) for each in seen]
    lines = [
        "".join(" " if step < below else _LEVELS[min(step - below, full - 1)] for step in steps)
        for below in range((height - 1) * full, -1, -full)
    ]
    return Text("\n".join(lines), "cyan")


def scaled(member: Member, name: str, width: int, height: int = 1) -> Text:
    """The trend of *name*, and behind its last line the least and the greatest value that it shows."""
    seen = list(member.trends.get(name, ()))
    if not seen or member.watched is None:
        return Text("")
    row = member.watched.rows[name]

    def ends(count: int) -> str:
        least, greatest = (row.text(end(seen[-count:])) for end in (min, max))
        return least if least == greatest else f"{least}…{greatest}"

    # Of fewer values the ends may be the longer ones: 9.49…30.00 and then 21.49…30.00.
    room = next((room for room in range(width, 0, -1) if room + 1 + len(ends(room)) <= width), 0)
    if room < 1:
        return Text(ends(width), "dim")
    drawn = trend(member, name, room, height)
    # Behind the last of its lines, which all have a letter for each value.
    drawn.pad_right(max(room - len(seen), 0))
    return drawn.append(f" {ends(room)}", "dim")


def values(member: Member, shown_big: Sequence[str], width: int, height: int, page: int) -> Text:
    """The other values, in as many columns as *width* takes; what does not fit is on other pages, which are counted."""
    watched = member.watched
    if watched is None or height < 1:
        return Text("")
    names = [name for name, row in watched.rows.items() if name not in shown_big and not row.bits]
    cells = []
    trends = width >= 2 * (_CELL + _TREND)
    for name in names:
        text = Text(f"{named(name):<21.21} {value(member, name):>8} {watched.rows[name].unit:<5.5}")
        cells.append(text.append_text(_filled(scaled(member, name, _TREND), _TREND)) if trends else text)
    across = max(1, width // (_CELL + _TREND if trends else _CELL))
    room = height * across
    if len(cells) > room:
        each = max(room - 1, 1)  # one place says that there are more
        pages = -(-len(cells) // each)
        at = page % pages
        more = Text(f"page {at + 1} of {pages}: PageDown", "bold")
        cells = [*cells[at * each : (at + 1) * each], more][:room]
    lines = Text()
    down = -(-len(cells) // across)
    for row in range(down):
        for cell in cells[row::down]:
            lines.append_text(cell).append(_BETWEEN)
        lines.append("\n")
    return lines


_BETWEEN = "  "
_CELL = 21 + 1 + 8 + 1 + 5 + len(_BETWEEN)
"""Columns of one value: name, value, unit, and what lies between them."""
_TREND = 24
"""Columns of its trend, where there is room."""


def _filled(text: Text, width: int) -> Text:
    text.pad_right(max(width - text.cell_len, 0))
    return text


def lamps(member: Member) -> list[Text]:
    """The terminals, as lamps: a line for each word that has bits."""
    watched = member.watched
    if watched is None or watched.now is None:
        return []
    lines = []
    for name, row in watched.rows.items():
        if not row.bits or name not in watched.now:
            continue
        shown = Text(f"{row.label:<16} ")
        for bit, told in watched.profile.fields(name, int(watched.now[name])).items():
            on = told == "on"
            shown.append(f"{_ON if on else _OFF} ", "bold green" if on else "dim").append(
                f"{bit}  ", "" if on else "dim"
            )
        lines.append(shown)
    return lines


def fault(member: Member) -> Text:
    """The present fault with cause and remedy, or why nothing is known of the drive; empty if all is well."""
    watched = member.watched
    if member.why:
        return Text(printable(f"{_nothing(member)}, trying again: {member.why}"), "yellow")
    if watched is None or watched.now is None or watched.fault is None or watched.fault not in watched.now:
        return Text("")
    code = watched.profile.fault_number(int(watched.now[watched.fault]))
    if not code:
        return Text("")
    present = watched.profile.fault(code)
    told = Text(printable(str(present)), "bold red")
    for what, text in (("cause", present.cause), ("remedy", present.remedy)):
        if text:
            told.append(f"\n{what}: ", "bold").append(printable(text))
    return told


def line(member: Member) -> Text:
    """How the line does, and what the bus makes of that."""
    stats = member.line.stats
    if stats is None:
        return Text("line: nothing was asked yet", "dim")
    unit = member.session.unit
    own = stats.units.get(unit, stats)
    silent, damaged = own.timeouts, own.crc_errors + own.bad_answers
    told = Text("line: ", "bold")
    link = member.line.links.get(unit)
    told.append("nothing was asked yet" if link is None or not link.asked else str(link))
    told.append(f"; {silent} silent, {damaged} damaged", "yellow" if silent or damaged else "")
    if own.answers:
        told.append(f"; {own.round_trip.min * 1e3:.0f} to {own.round_trip.max * 1e3:.0f} ms")
    for hint in stats.hints:
        # What is said of another unit is said there.
        if not hint.startswith("unit ") or hint.startswith(f"unit {unit}:"):
            told.append(f"\n{printable(hint)}", "yellow")
    return told
