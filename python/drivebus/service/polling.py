"""What the drives of one line are asked again and again, on its way into the spool."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from drivebus.bus import Bus
from drivebus.drive import Drive
from drivebus.line.poll_samples import Sample
from drivebus.operations import glances, state
from drivebus.operations.drive_base import unit_of
from drivebus.operations.registers import monitored
from drivebus.poll import Poll
from drivebus.profile.evidence import Evidence
from drivebus.service.changes import Changes
from drivebus.service.events import Events
from drivebus.service.handles import handle_of
from drivebus.sinks.picture import DrivePicture
from drivebus.site import SiteLine, SitePoll
from drivebus.spool import Layout, Spool
from drivebus.values import digits_of

__all__ = ["Polling", "layout_of"]


class Polling:
    """The polls of one line, as often as it is opened.

    Args:
        line: The line.
        polls: What is asked, on this line and on others.
        spool: Where it goes.
        events: Hears of what each drive says.
    """

    def __init__(self, line: SiteLine, polls: tuple[SitePoll, ...], spool: Spool | None, events: Events) -> None:
        self._polls = [
            (place, poll, chosen)
            for place, poll in enumerate(polls, 1)
            if (chosen := [drive for drive in poll.drives if drive.line == line])
        ]
        self._spool = spool
        self._events = events
        self._begun: list[Poll[Drive]] = []
        self._lock = threading.Lock()
        self._last: dict[tuple[int, str], DrivePicture] = {}

    def begin(self, bus: Bus, stack: ExitStack) -> None:
        """Polls the drives on *bus*, until *stack* is closed.

        Raises:
            NotAllowed: A name is unknown or may not be read, or the interval is shorter than the line can carry.
        """
        self._begun = []
        for place, poll, chosen in self._polls:
            drives = {handle_of(bus, each): each.name for each in chosen}
            series = {drive: _Series(name, drive, poll) for drive, name in drives.items()}
            names = {drive: of.layout.names for drive, of in series.items()}
            begun = bus.poll(names, poll.interval, callback=partial(self._take, place, series))
            self._begun.append(stack.enter_context(begun))

    def check(self) -> None:
        """Raises what ended a poll, if anything did."""
        for poll in self._begun:
            poll.wait(0.0)

    def status(self) -> dict[str, dict[str, Any]]:
        """Of each drive when it was asked last, as Unix time, and why there was no answer."""
        last = sorted(self.last(), key=lambda each: each.time)
        return {each.layout.drive: {"time": round(each.time, 3), "missing": each.missing} for each in last}

    def last(self) -> tuple[DrivePicture, ...]:
        """What each drive said last, in each poll."""
        with self._lock:
            return tuple(self._last.values())

    def _take(self, place: int, series: Mapping[Drive, _Series], sample: Sample[Drive]) -> None:
        of = series[sample.key]
        missing = "" if sample.missing is None else str(sample.missing)
        # A unit that is silent goes on being silent, whether it was asked or spared.
        kind = "" if sample.missing is None else type(sample.missing).__name__
        values = [] if missing else [sample[name] for name in of.layout.names]
        doing, fault = ("", "") if missing else of.read_off(sample)
        said = DrivePicture(place, of.layout, sample.time, missing, tuple(values), doing, fault, of.interval)
        with self._lock:
            self._last[place, of.layout.drive] = said
        self._events.saw(said)
        if self._spool is not None and of.changes.keeps(sample.time, kind, values):
            self._spool.add(of.layout, sample.time, sample.answered - sample.time, missing, values)


class _Series:
    """The samples of one drive in one poll."""

    def __init__(self, name: str, drive: Drive, poll: SitePoll) -> None:
        self._unit = unit_of(drive)
        self._told = glances.planned(self._unit.evidence)
        self.layout = layout_of(name, self._unit.evidence, poll.registers)
        # The sample nearest to the heartbeat: none comes on time to the microsecond.
        heartbeat = poll.heartbeat - poll.interval / 2
        self.interval = poll.interval
        self.changes = Changes([poll.band.get(register, 0.0) for register in self.layout.names], heartbeat)

    def read_off(self, sample: Sample[Drive]) -> tuple[str, str]:
        """What the drive is doing, and the fault that it is in, in words; empty what it does not tell."""
        profile = self._unit.profile
        word, fault = (None if name is None else int(sample[name]) for name in (self._told.state, self._told.fault))
        doing, number, in_fault = state.read_off(self._unit, word, fault)
        told = "" if word is None else str(doing)
        if number and (in_fault or word is None):
            return told, str(profile.fault(number))
        return told, "a fault that it does not name" if in_fault else ""


def layout_of(name: str, evidence: Evidence, registers: Sequence[str]) -> Layout:
    """What the samples of the drive *name* have, which is asked for *registers*, or for what its family has to tell."""
    told, profile = glances.planned(evidence), evidence.profile
    asked = [*(registers or monitored(evidence)), told.state, told.fault]
    names = tuple(dict.fromkeys(each for each in asked if each is not None))
    rows = [profile.describe(each) for each in names]
    return Layout(
        name, profile.name, names, tuple(row.unit for row in rows), tuple(digits_of(row.scale) for row in rows)
    )
