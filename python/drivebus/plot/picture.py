"""What there is to see of a recording: curves by unit, bands of states, gaps and events."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from drivebus.errors import BadArgument
from drivebus.plot.downsample import thinned
from drivebus.record.reading import Event, Recording
from drivebus.record.table import moment

__all__ = ["Band", "Curve", "Mark", "Picture", "from_zero", "of_recording", "of_samples"]

_FIRST = ["Hz", "rpm", "A", "V", "%"]
"""The units that stand above the others."""

_NEAR_ZERO = 0.9
"""A curve whose least value is below this share of its greatest is drawn from 0 on."""


class Sampled(Protocol):
    """Samples of one drive: what a trial gives."""

    times: list[float]
    values: dict[str, list[float]]
    units: dict[str, str]
    began: float


@dataclass(frozen=True, slots=True)
class Curve:
    """One value over time.

    Attributes:
        label: What it is called.
        times: Seconds since the picture's beginning.
        values: As many; None in a gap, which is not drawn over.
    """

    label: str
    times: Sequence[float]
    values: Sequence[float | None]


@dataclass(frozen=True, slots=True)
class Band:
    """A state of a drive, or a bit that is on, from one moment to another, in seconds since the picture's beginning.

    Attributes:
        drive: What stands in front of it: the drive, or the bit.
        state: What it is called.
        begin: The moment of the first sample that shows it.
        end: The moment of the first that does not.
        lamp: Whether it is a bit.
    """

    drive: str
    state: str
    begin: float
    end: float
    lamp: bool = False


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happened at one moment, in seconds since the picture's beginning."""

    time: float
    kind: str
    text: str


@dataclass
class Picture:
    """What is drawn.

    Attributes:
        title: Stands above it.
        began: Unix time in seconds of the moment 0.
        panels: Curves by their unit, in the order in which they are drawn under each other.
        bands: States of drives, then bits of words.
        gaps: Where a drive was not heard: its name, and from when to when.
        marks: Faults and other events.
        left_out: Values that were 0 all the time.
        late: How often samples were not taken because the line was busy.
    """

    title: str
    began: float
    panels: dict[str, list[Curve]] = field(default_factory=dict)
    bands: list[Band] = field(default_factory=list)
    gaps: list[tuple[str, float, float]] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    late: int = 0

    @property
    def axis(self) -> str:
        """What stands under the time axis."""
        return f"seconds since {moment(self.began)[:19].replace('T', ' ')} UTC"


def of_recording(
    recording: Recording,
    title: str,
    names: Sequence[str] = (),
    *,
    begin: float = 0.0,
    end: float | None = None,
    points: int = 4000,
) -> Picture:
    """The picture of *recording*.

    Args:
        recording: What was read.
        title: Stands above it.
        names: The registers that are drawn, as they are called in the file, with or without their unit. Empty: all
            that have a number and were not 0 all the time.
        begin: Seconds since the recording's beginning; nothing before is drawn.
        end: The same for what is behind; None: to its end.
        points: A curve has about so many points at most. Peaks are kept.

    Raises:
        NotAllowed: There is no such register, or nothing to draw.
    """
    known = {title for drive in recording.drives for title in recording.values[drive]}
    wanted = {_titled(name, known) for name in names}
    moments = [times[0] for times in recording.times.values() if times]
    first = min([*(event.time for event in recording.events), *moments])
    picture = Picture(title, first + begin)
    last = max(
        [*(event.time for event in recording.events), *(times[-1] for times in recording.times.values() if times)]
    )
    until = last if end is None else min(first + end, last)
    for drive in recording.drives:
        gaps = _gaps([event for event in recording.events if event.drive == drive], until)
        inside = [(max(at, picture.began), min(to, until)) for at, to in gaps]
        picture.gaps += [(drive, at - picture.began, to - picture.began) for at, to in inside if to > at]
        _take(picture, recording, drive, wanted, gaps, until, points)
    picture.marks = [
        Mark(event.time - picture.began, event.kind, _told(event, len(recording.drives) > 1))
        for event in recording.events
        if event.kind in ("fault", "fault cleared", "lost") and picture.began <= event.time <= until
    ]
    picture.bands.sort(key=lambda band: band.lamp)
    late = [event for event in recording.events if event.kind == "late" and picture.began <= event.time <= until]
    # All drives of a line are late at the same time.
    picture.late = max((sum(event.drive == drive for event in late) for drive in recording.drives), default=0)
    if not picture.panels and not any(band.lamp for band in picture.bands):
        raise BadArgument(f"{title}: there is nothing to draw: all values in this time are 0. Did the motor run?")
    picture.panels = {unit: picture.panels[unit] for unit in sorted(picture.panels, key=_rank)}
    return picture


def of_samples(samples: Sampled, title: str) -> Picture:
    """The picture of *samples*, such as those of a trial."""
    picture = Picture(title, samples.began)
    for name, values in samples.values.items():
        picture.panels.setdefault(samples.units.get(name, ""), []).append(Curve(name, samples.times, values))
    picture.panels = {unit: picture.panels[unit] for unit in sorted(picture.panels, key=_rank)}
    return picture


def from_zero(curves: Sequence[Curve]) -> bool:
    """Whether an axis for *curves* begins at 0: cut off, a small change would look like a large one."""
    values = [value for curve in curves for value in curve.values if value is not None]
    return bool(values) and 0 <= min(values) < _NEAR_ZERO * max(values)


def _rank(unit: str) -> tuple[int, str]:
    return (_FIRST.index(unit), unit) if unit in _FIRST else (len(_FIRST) + (not unit), unit)


def _titled(name: str, known: set[str]) -> str:
    """The title of the column that *name* means."""
    for title in known:
        if name in (title, title.partition(" [")[0]):
            return title
    raise BadArgument(f'there is no "{name}" in the recording; it has {", ".join(sorted(known))}')


def _take(
    picture: Picture,
    recording: Recording,
    drive: str,
    wanted: set[str],
    gaps: Sequence[tuple[float, float]],
    until: float,
    points: int,
) -> None:
    """Takes the curves and bands of *drive*."""
    times = recording.times[drive]
    places = [place for place, time in enumerate(times) if picture.began <= time <= until]
    seen = [(times[place] - picture.began, recording.states[drive][place]) for place in places]
    picture.bands += _bands(drive, seen, [at - picture.began for at, _ in gaps])
    units = recording.units(drive)
    prefix = f"{drive} " if len(recording.drives) > 1 else ""
    for title, values in recording.values[drive].items():
        if (wanted and title not in wanted) or any(isinstance(value, str) for value in values):
            continue
        shown = [(times[place] - picture.began, values[place]) for place in places if values[place] is not None]
        if not shown or (not wanted and not any(value for _, value in shown)):
            picture.left_out += [] if not shown else [prefix + title]
            continue
        name = title.partition(" [")[0]
        if bits := recording.bits(drive, name):
            for bit, meaning in bits.items():
                lit = [(at, _lit(meaning, int(value))) for at, value in shown]
                picture.bands += [
                    replace(band, drive=f"{prefix}{name} {bit}", lamp=True)
                    for band in _bands(drive, lit, [at - picture.began for at, _ in gaps])
                ]
            continue
        points_of = _with_gaps(shown, [at - picture.began for at, _ in gaps])
        curve = Curve(prefix + name, *thinned([at for at, _ in points_of], [value for _, value in points_of], points))
        picture.panels.setdefault(units[title], []).append(curve)


def _lit(meaning: Mapping[str, Any], word: int) -> str:
    """What a field of *word* says, by its mask and labels; empty where it is 0."""
    mask = meaning["mask"]
    value = (word & mask) // (mask & -mask) if mask else 0
    return str(meaning["labels"].get(str(value), value)) if value else ""


def _with_gaps(shown: Sequence[tuple[float, float]], gaps: Sequence[float]) -> list[tuple[float, float | None]]:
    """The points, with a None where a gap begins."""
    holes: list[tuple[float, float | None]] = [(at, None) for at in gaps if shown[0][0] < at < shown[-1][0]]
    return sorted([*shown, *holes], key=lambda point: point[0]) if holes else list(shown)


def _bands(drive: str, seen: Sequence[tuple[float, str]], gaps: Sequence[float]) -> list[Band]:
    """The states of *drive*, each until the next, but not across one of *gaps*: nobody knows what it did there."""
    bands: list[Band] = []
    for (time, state), (following, _) in itertools.pairwise([*seen, *seen[-1:]]):
        end = min([following, *(gap for gap in gaps if time <= gap < following)])
        if bands and bands[-1].state == state and bands[-1].end == time:
            bands[-1] = Band(drive, state, bands[-1].begin, end)
        elif state:
            bands.append(Band(drive, state, time, end))
    return bands


def _gaps(events: Sequence[Event], until: float) -> list[tuple[float, float]]:
    found: list[tuple[float, float]] = []
    began: float | None = None
    for event in events:
        if event.kind == "gap":
            began = event.time
        elif event.kind == "back" and began is not None:
            found.append((began, event.time))
            began = None
    return found if began is None else [*found, (began, until)]


def _told(event: Event, several: bool) -> str:
    whose = f"{event.drive}: " if several and event.drive else ""
    return f"{whose}{event.text or event.kind}"
