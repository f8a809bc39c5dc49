"""The drives that the panel shows: who they are, what they said last, and what the line says of itself.

Each line has two threads of its own: one polls, the other finds out who the drives are, and goes on trying where one
does not answer. The screen takes what is newest and waits for nobody.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import Any

import drivebus
from drivebus.cli import watch_list
from drivebus.cli.panel.journal import Journal
from drivebus.cli.panel.motors import PanelMotor
from drivebus.cli.present.error_wording import in_commands
from drivebus.cli.present.motors import on_the_way
from drivebus.cli.present.screen import Watched
from drivebus.cli.session import Session

__all__ = ["Member", "WatchedLine", "opened"]

KEPT = 240
"""Values of each trend that are kept: a minute, at four a second."""

_INTERVAL = 0.25
"""Seconds from one sample to the next, where the line can carry that. A screen shows no more."""
_AGAIN = 1.0
"""Seconds after which a drive that did not answer is looked for again, for each such drive."""
_GLANCE = 0.1
"""Seconds that such a drive is given: it must not keep the others waiting."""
_RISE = 0.5
"""Hz that a motor on its way to a stop does not gain."""


class Member:
    """One drive.

    Attributes:
        session: The options that name it.
        line: What it hangs on.
        motor: What this panel tells its motor.
        drive: The drive; None while it is not known what it is.
        watched: What is shown of it; None while it is not known what it is.
        highest: Its highest frequency in Hz, as it is set; None if that is not known.
        problem: Why it is not known, or not polled; None if it is.
        trends: The latest values of each register, the newest last.
        asked: What it is polled for.
        may_be: The families that it may be of and that have a profile, where it does not say surely which.
        told: What its status words say beside the state, in the drive's own words.
    """

    def __init__(self, session: Session, line: WatchedLine, journal: Journal, watchdog: float | None) -> None:
        self.session = session
        self.line = line
        self.motor = PanelMotor(session.called, self._halt, self._tell, journal, watchdog)
        self._journal = journal
        self._fault: int | None = None
        self.drive: drivebus.Drive | None = None
        self.watched: Watched | None = None
        self.highest: float | None = None
        self.problem: drivebus.DrivebusError | None = None
        self.trends: dict[str, deque[float]] = {}
        self.told: dict[str, str] = {}
        self.may_be: list[str] = []
        self._is_unsure = False
        self.asked: list[str] = []
        self._words: list[str] = []
        self._newest: drivebus.Sample | None = None
        self._taken: drivebus.Sample | None = None
        self._slowest = 0.0, math.inf

    @property
    def called(self) -> str:
        """What people call it."""
        return self.session.called

    @property
    def what(self) -> str:
        """What and where it is, such as "unit 1, Goodrive350 on /dev/ttyUSB0"."""
        family = "" if self.drive is None else f", {self.drive.profile.title}"
        unit = f"unit {self.session.unit}{family} on {self.session.port}"
        return f"{self.session.name} ({unit})" if self.session.name else unit

    @property
    def why(self) -> str:
        """Why nothing is known of it now; empty if something is."""
        if self.watched is not None:
            return self.watched.missing
        if self.problem is None:
            return ""
        naming = f"give `{self.naming}`" + (" in drivebus.toml" if self.session.name else "")
        return in_commands(self.problem).replace("give `--profile`", naming)

    @property
    def naming(self) -> str:
        """How its family can be named, where it does not say itself what it is; empty where that helps nothing."""
        if not self._is_unsure or self.problem is None:
            return ""
        family = self.may_be[0] if len(self.may_be) == 1 else "NAME"
        return f'profile = "{family}"' if self.session.name else f"--profile {self.session.unit}={family}"

    @property
    def likely(self) -> str:
        """The one family that it may be of, where it does not say itself what it is; empty where there are several."""
        return self.may_be[0] if self.naming and len(self.may_be) == 1 else ""

    def take_as(self, family: str) -> None:
        """Takes it as of *family* from the next look on."""
        self.session = replace(self.session, profile=family)
        self._journal.say(f"{self.called}: taken as a {family} until this panel ends; {self.naming} names it")

    @property
    def is_silent(self) -> bool:
        """Whether it does not answer now. One that answers, and does not say what it is, is not silent."""
        return bool(self.why) and not isinstance(self.problem, drivebus.NotAllowed)

    def role(self, role: str) -> str | None:
        """The register with *role*, if it is watched."""
        if self.watched is None:
            return None
        name = self.watched.profile.role(role)
        return name if name in self.watched.rows else None

    def identify(self, again: bool) -> bool:
        """Finds out what it is; returns whether it did. *again*: it did not answer before."""
        bus = self.line.bus
        drive = None
        try:
            # Who is silent costs the others as little as can be.
            if (
                again
                and self.session.profile is None
                and not list(bus.scan([self.session.unit], _GLANCE, protocol="modbus"))
            ):
                return False
            drive = self.session.drive_on(bus)
            watched = watch_list.watched(self.session, drive)
        except drivebus.DrivebusError as error:
            self._is_unsure = drive is None and isinstance(error, drivebus.NotAllowed) and self.session.profile is None
            if self._is_unsure and not self.may_be:
                self._ask_families()
            self.problem = error
            return False
        self._words = [name for name in drive.profile.status_words if _may_be_read(drive, name)]
        self.asked = list(dict.fromkeys([*watch_list.asked(watched), *self._words]))
        self.drive, self.watched, self.problem = drive, watched, None
        return True

    def _ask_families(self) -> None:
        """Asks which families it may be of."""
        with suppress(drivebus.DrivebusError):
            found = self.line.bus.identify(self.session.unit)
            self.may_be = [name for name in found.candidates if name in drivebus.profiles()]

    def ask_limit(self) -> None:
        """Asks for its highest frequency."""
        if self.drive is None or self.drive.profile.maximum_frequency is None:
            return
        try:
            self.highest = float(self.drive.read(self.drive.profile.maximum_frequency))
        except drivebus.DrivebusError:
            return  # then the scale of the trend is what was seen

    def put(self, sample: drivebus.Sample) -> None:
        """Takes the newest sample, in the thread of the poll."""
        self._newest = sample

    def take(self) -> bool:
        """Shows from now on what came last; returns whether that is new."""
        sample = self._newest
        if sample is None or sample is self._taken or self.watched is None:
            return False
        self._taken = sample
        self.watched.take(sample)
        if sample.missing is None:
            self._see_whether_it_trips(sample)
            self._see_whether_it_slows(sample)
            self.told = {}
            for word in self._words:
                self.told.update(self.watched.profile.fields(word, int(sample[word])))
            for name in self.watched.rows:
                self.trends.setdefault(name, deque(maxlen=KEPT)).append(float(sample[name]))
        return True

    @property
    def state(self) -> drivebus.State | None:
        """What it said last that it does; None if it does not tell."""
        watched = self.watched
        if watched is None or watched.now is None or watched.state is None or watched.state not in watched.now:
            return None
        return drivebus.State(watched.profile.state(int(watched.now[watched.state])))

    def _see_whether_it_trips(self, sample: drivebus.Sample) -> None:
        """Says in the journal that it tripped, or was in fault when it was seen first."""
        assert self.watched is not None
        if self.watched.fault is None or self.watched.fault not in sample:
            return
        profile, before = self.watched.profile, self._fault
        self._fault = profile.fault_number(int(sample[self.watched.fault]))
        if self._fault and self._fault != before:
            happened = "is in fault" if before is None else "tripped"
            self._journal.say(f"{self.called} {happened}: {profile.fault(self._fault)}", "bold red")

    def _see_whether_it_slows(self, sample: drivebus.Sample) -> None:
        """One that stands is not on its way to a stop any more, nor is one that somebody else has started again."""
        since, least = self._slowest
        if not self.motor.is_slowing or sample.time < since:
            return
        name = self.role("frequency")
        now = 0.0 if name is None else abs(float(sample[name]))
        self._slowest = since, min(now, least)
        if now > least + _RISE or self.state is None or not self.state.running:
            self.motor.is_slowing = False

    def _tell(self) -> str:
        """What the motor does that was told to stop."""
        self._slowest = 0.0, math.inf
        if self.drive is None:
            return "what it does now is not known"
        try:
            status = self.drive.status()
        except drivebus.DrivebusError as error:
            return f"what it does now could not be read: {in_commands(error)}"
        self._slowest = status.time, math.inf if status.frequency is None else abs(status.frequency)
        return on_the_way(status, drivebus.State.STOPPED) or str(status)

    def _halt(self, confirm: float | None) -> None:
        """Stops it: with its own code where it is known what it is."""
        options: dict[str, Any] = {} if confirm is None else {"confirm": confirm}
        if self.drive is not None:
            self.drive.stop(**options)
        else:
            self.session.halt(self.line.bus, "stop", lambda drive: drive.stop(**options))


class WatchedLine:
    """One bus, and the drives on it that are shown.

    Attributes:
        bus: The bus.
        port: What it was opened as.
        members: The drives.
        stats: Its figures, a second old at most; None before the first.
        links: How well each drive could be reached, as old.
    """

    def __init__(self, bus: drivebus.Bus, port: str) -> None:
        self.bus = bus
        self.port = port
        self.members: list[Member] = []
        self.stats: drivebus.Stats | None = None
        self.links: dict[int, drivebus.Link] = {}
        self._over = threading.Event()
        self._more = threading.Event()
        self._threads: list[threading.Thread] = []

    def begin(self) -> None:
        """Begins to ask."""
        for work in (self._identify, self._watch):
            thread = threading.Thread(target=work, name=f"panel {self.port}", daemon=True)
            self._threads.append(thread)
            thread.start()

    def end(self) -> None:
        """Asks no more. Returns when what is under way is over."""
        self._over.set()
        self._more.set()
        for thread in self._threads:
            thread.join()

    def _identify(self) -> None:
        """Until all are known: those that do not answer are looked for again and again."""
        again = False
        while not self._over.is_set():
            unknown = [member for member in self.members if member.drive is None]
            if not unknown:
                return
            for member in unknown:
                if self._over.is_set():
                    return
                if member.identify(again):
                    self._more.set()
                    member.ask_limit()
            again = True
            self._over.wait(_AGAIN * len(unknown))

    def _watch(self) -> None:
        """Polls all that are known; once more are, those too."""
        while not self._over.is_set():
            self._more.wait()
            self._more.clear()
            by_drive = {member.drive: member for member in self.members if member.drive is not None}
            if not by_drive or self._over.is_set():
                continue
            try:
                with self._poll(by_drive) as poll:
                    self._take(poll, by_drive)
            except drivebus.DrivebusError as error:
                # A bus that was closed, or a profile that asks for what no request holds.
                for member in by_drive.values():
                    member.problem = error
                return

    def _poll(self, by_drive: dict[drivebus.Drive, Member]) -> drivebus.Poll[Any]:
        asked = {drive: member.asked for drive, member in by_drive.items()}
        # Of each drive the newest is kept, and no more.
        try:
            return self.bus.poll(asked, _INTERVAL, size=len(asked))
        except drivebus.NotAllowed:
            return self.bus.poll(asked, None, size=len(asked))

    def _take(self, poll: drivebus.Poll[Any], by_drive: dict[drivebus.Drive, Member]) -> None:
        beats = 0
        while True:
            # In virtual time nothing is asked unless somebody waits for it.
            for sample in poll.batch(len(by_drive), timeout=_INTERVAL):
                by_drive[sample.key].put(sample)
            if beats % 4 == 0:
                units = [member.session.unit for member in self.members]
                self.links = {unit: self.bus.link(unit) for unit in units}
                self.stats = self.bus.stats()
            beats += 1
            if self._over.wait(_INTERVAL) or self._more.is_set():
                return


@contextmanager
def opened(session: Session, journal: Journal, watchdog: float | None) -> Iterator[list[Member]]:
    """The drives that *session* names, in its order, each on a line that is open.

    Raises:
        PortError: A port is not there, busy or not permitted.
    """
    lines: dict[str, WatchedLine] = {}
    members = []
    with ExitStack() as stack:
        for named in session.several or (session,):
            # Whoever may be commanded is, whatever is beside it.
            one = replace(named, beside_unit_0=False)
            key = one.line_key
            if key not in lines:
                lines[key] = WatchedLine(stack.enter_context(one.bus()), one.one_port())
            member = Member(one, lines[key], journal, watchdog)
            lines[key].members.append(member)
            members.append(member)
        for line in lines.values():
            line.begin()
            stack.callback(line.end)
        yield members


def _may_be_read(drive: drivebus.Drive, name: str) -> bool:
    try:
        return bool(drive.readable(name))
    except drivebus.NotAllowed:
        return False
