"""A plant as pages show it: plain data, the same for what the server writes and for what a browser puts in its place.

A value is shown with its age, and its poll says when it is old. What several polls ask is shown as the newest has it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from drivebus.sinks.picture import DrivePicture, LinePicture, Picture
from drivebus.values import Value
from drivebus.web.shown import Happened, Shown, ShownDrive

__all__ = ["LEAST_OLD", "OLD", "LineTimes", "ago", "happened", "plain", "view"]

OLD, LEAST_OLD = 3.0, 3.0
"""A value is old after so many intervals of its poll, and not before so many seconds: pictures come once a second."""
_RECENT = 20.0
"""Seconds over which it is said how much of a line is used."""
_LONGEST = 300
"""Characters of one text."""


class LineTimes(NamedTuple):
    """By the names of lines, for how many seconds requests had each, and when that was counted."""

    time: float
    occupied: Mapping[str, float]

    @classmethod
    def of(cls, picture: Picture) -> LineTimes:
        """Those of *picture*."""
        return cls(picture.time, {line.name: line.counts.get("occupied", 0.0) for line in picture.lines})


def view(shown: Shown, picture: Picture, before: LineTimes | None) -> dict[str, Any]:
    """All that is shown of *picture*; how much of a line is used comes of the one *before*."""
    lines = [_line(line, picture, before) for line in picture.lines]
    started = shown.started()
    of_line = {line.name: line for line in picture.lines}
    drives = [_drive(each, of_line.get(each.line), picture.time, started) for each in shown.drives.values()]
    for line in lines:
        line["late"] = [each["name"] for each in drives if each["line"] == line["name"] and each["quality"] != "good"]
    return {"time": picture.time, "lines": lines, "drives": drives}


def _line(line: LinePicture, picture: Picture, before: LineTimes | None) -> dict[str, Any]:
    share = None
    if line.open and before is not None and 0 < picture.time - before.time < _RECENT:
        used = line.counts.get("occupied", 0.0) - before.occupied.get(line.name, 0.0)
        # Opened again meanwhile, it counts from nothing.
        share = min(max(used, 0.0) / (picture.time - before.time), 1.0)
    return {
        "name": line.name,
        "open": line.open,
        "share": "" if share is None else f"{share:.0%}",
        "why": plain(line.why),
        "hints": [plain(hint) for hint in line.hints],
        "requests": f"{line.counts.get('requests', 0):,.0f}",
        "timeouts": f"{line.counts.get('timeouts', 0):,.0f}",
        "clients": sum(gateway.clients for gateway in line.gateways),
    }


def _drive(drive: ShownDrive, line: LinePicture | None, now: float, started: Mapping[str, str]) -> dict[str, Any]:
    told = {"name": drive.name, "line": drive.line, "by": started.get(drive.name, "")}
    said = sorted(
        (each for each in (line.drives if line else ()) if each.layout.drive == drive.name), key=lambda each: each.time
    )
    if line is None or not line.open:
        return told | _nothing("gone", "the line is away")
    if not said:
        return told | _nothing("unknown", "it was not asked yet")
    last = said[-1]
    if last.missing:
        return told | _nothing("gone", last.missing, last.time)
    values = _values(said)
    speed = next((each for each in values if each["unit"] == "Hz"), None)
    limit = _limit(last)
    return told | {
        # A time that lies ahead was told by a clock that was set since: how old it is, nobody knows.
        "quality": "good" if -LEAST_OLD <= now - last.time <= limit else "old",
        "missing": "",
        "time": last.time,
        "limit": limit,
        "state": plain(last.state),
        "fault": plain(last.fault),
        "speed": "" if speed is None else f"{speed['text']} Hz",
        "values": values,
    }


def _nothing(quality: str, why: str, at: float | None = None) -> dict[str, Any]:
    shown = {"quality": quality, "missing": plain(why), "time": at, "limit": 0.0}
    return shown | {"state": "", "fault": "", "speed": "", "values": []}


def _values(said: Iterable[DrivePicture]) -> list[dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for each in said:
        if each.missing:
            # What another poll had before is not shown beside that the drive gives nothing.
            found.clear()
            continue
        layout = each.layout
        for name, unit, digits, value in zip(layout.names, layout.units, layout.digits, each.values, strict=False):
            text = {"name": name, "unit": unit, "text": _number(value, digits), "time": each.time}
            found[name] = text | {"limit": _limit(each)}
    return list(found.values())


def _number(value: Value, digits: int) -> str:
    return f"{value:.{digits}f}"


def _limit(drive: DrivePicture) -> float:
    return max(OLD * drive.interval, LEAST_OLD)


def happened(events: Iterable[Happened], subject: str | None = None, most: int = 200) -> list[dict[str, Any]]:
    """The last *most* events, the newest first; those of one *subject* alone, if it is given."""
    chosen = [each for each in events if subject is None or each.subject == subject]
    return [
        {"time": each.time, "subject": plain(each.subject), "kind": each.kind, "text": plain(each.text)}
        for each in reversed(chosen[-most:])
    ]


def plain(text: str) -> str:
    """*text* as it can be shown: what controls a terminal or the direction of writing is written out, and it ends."""
    short = text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in short)


def ago(seconds: float) -> str:
    """How long ago something was, for people; pages say it in the same words."""
    if seconds < 10:
        return f"{max(seconds, 0.0):.1f} s"
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7_200 else f"{seconds / 3_600:.0f} h"
