"""The search itself: opens the port at one setting after the other, listens, asks, and tells who answered.

A master that has just opened a port cannot know whose answer it hears first, so a bus makes sure of each unit by echoes
during its first second. A search may not send those to units that nobody knows. It listens for that second instead,
which also tells whether somebody else is master of the line.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Mapping
from types import TracebackType

from drivebus import checks
from drivebus.bus import Bus
from drivebus.errors import BadAnswer, BadArgument, NoAnswer, PortError
from drivebus.identify.scan import speaks_otherwise
from drivebus.line import huanyang, port_facts
from drivebus.line.frames import frames_in, may_be_of
from drivebus.line.stats import noisy
from drivebus.line_search.located import Located, Progress
from drivebus.line_search.order import longest_delay
from drivebus.line_search.plan import Plan
from drivebus.line_search.settings import Settings, can_be_changed

__all__ = ["Search", "search"]

_LISTEN = 1.0
"""Seconds: as long as a bus is in doubt whose answers it hears."""

_ADAPTER = 0.03
"""Seconds that an adapter, its driver and a busy machine may keep an answer; FTDI's latency timer is 16 ms."""

_ANSWER = 7
"""Characters of an answer with one word."""

_TIMES = 3
"""How often somebody is asked whose answer is damaged: a bad line is not a wrong setting."""

_LONGEST = 2048
"""Bytes of what was heard in which frames are looked for."""


def search(
    port: str | os.PathLike[str] | object,
    *,
    baudrate: int = 19200,
    parity: str = "E",
    stopbits: int = 1,
    bytesize: int = 8,
    full: bool = False,
    timeout: float | None = None,
    rs485: Mapping[str, object] | None = None,
    progress: Callable[[Progress], object] | None = None,
    open: Callable[..., Bus] = Bus,  # noqa: A002 - what it is
) -> Search:
    """Searches the line at *port* for drives whose baud rate, format and address nobody knows, and yields them.

    Sends reads of one word. The likely addresses (1 to 16) are asked at the likely settings, those of factories first;
    every address where anybody answers, and at the settings of factories. That takes about a minute. Until anybody
    answers, unit 1 is also asked in Huanyang's own protocol: a question that a unit of Modbus refuses.
    Each drive is yielded when it is found. `Search.untried` has what was left out.

    A port whose settings are not ours, such as a serial server, a gateway or a simulated line, is asked at those it
    has, every address. The port must be free: it is opened again and again, so no other program can share it meanwhile.

    Args:
        port: As for `Bus`.
        baudrate: Bits per second that are tried first.
        parity: The same for `"N"`, `"E"` or `"O"`.
        stopbits: The same for 1 or 2.
        bytesize: The same for 7 or 8.
        full: Every address at every setting that drives can have: 20 minutes.
        timeout: Seconds each is given to answer. None: what the slowest family takes as it leaves the factory (20 ms),
            30 ms for the adapter, and the time of the characters.
        rs485: As for `Bus`.
        progress: Is called before each question.
        open: What opens a bus; called as `Bus` is, for each of the settings tried.

    Raises:
        NotAllowed: An argument is wrong.

    While it is iterated over:

    Raises:
        PortError: The port is not there, busy, not permitted, or was lost.
        BadAnswer: Somebody else is master of this line. Nobody is asked from then on.
    """
    first = Settings(baudrate, bytesize, parity, stopbits)
    first.timing  # noqa: B018 - refuses what are no settings
    if timeout is not None:
        timeout = checks.number("timeout", timeout, 0.0, 3600.0, above=True)
    if progress is not None and not callable(progress):
        raise BadArgument(
            f"progress is {checks.shown(progress)}, which cannot be called; give a function that takes a Progress"
        )
    return Search(port, first, checks.flag("full", full), timeout, rs485, progress, open)


class Search(Iterator[Located]):
    """A search under way, as `search` begins it: gives each drive as it is found. Ending or closing it closes the port.

    In a `with` block it is closed whatever happens.
    """

    def __init__(
        self,
        port: object,
        first: Settings,
        full: bool,
        timeout: float | None,
        rs485: Mapping[str, object] | None,
        progress: Callable[[Progress], object] | None,
        open: Callable[..., Bus],  # noqa: A002 - what it is
    ) -> None:
        self._port = port
        self._first = first
        self._timeout = timeout
        self._rs485 = rs485
        self._progress = progress
        self._open = open
        self._delay = longest_delay()
        self._fixed = not can_be_changed(port)
        self._plan = Plan(first, self._fixed, full, self._patience, _LISTEN)
        self._damaged: dict[tuple[int, int], Located] = {}
        self._otherwise: set[tuple[int, int]] = set()
        self._has_opened = self._has_listened = False
        self._going = self._run()

    def __iter__(self) -> Search:
        return self

    def __next__(self) -> Located:
        return next(self._going)

    def close(self) -> None:
        """Ends it and closes the port. Closing again does nothing."""
        self._going.close()

    def __enter__(self) -> Search:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def untried(self) -> list[str]:
        """What was not tried up to now, in words: settings, addresses, and drives that are slower to answer."""
        told = self._plan.untried()
        if self._fixed:
            told.insert(0, "other baud rates and formats, which this port has from elsewhere")
        slow = f"{self._delay * 1e3:g} ms" if self._timeout is None else f"{self._timeout:g} s in all"
        other = f"that speak {huanyang.NAME} and have {self._plan.untried_otherwise()}"
        return [*told, f"drives that take longer than {slow} to answer, or {other}"]

    def _run(self) -> Generator[Located, None, None]:
        while (settings := self._plan.settings()) is not None:
            bus = self._opened(settings)
            if bus is None:
                continue
            with bus:
                is_quiet = self._listen(bus, settings)
                if is_quiet or self._has_listened or self._fixed:
                    yield from self._ask(bus, settings)
                    continue
            self._listen_elsewhere(settings)
        yield from self._damaged.values()

    def _ask(self, bus: Bus, settings: Settings) -> Iterator[Located]:
        """Asks those who are to be asked at *settings*, over *bus*."""
        for unit in self._to_ask(bus):
            self._tell(settings, unit)
            located = self._asked(bus, settings, unit)
            if located is None:
                continue
            key = settings.baudrate, unit
            if located.protocol != "modbus":
                yield from self._told_once(located)
            elif located.problem is None:
                self._plan.answered(unit)
                self._damaged.pop(key, None)
                yield located
            else:
                self._damaged.setdefault(key, located)
        yield from self._ask_otherwise(bus, settings)

    def _ask_otherwise(self, bus: Bus, settings: Settings) -> Iterator[Located]:
        """Asks in Huanyang's own protocol, where nobody has answered in Modbus."""
        for unit in self._plan.otherwise():
            self._tell(settings, unit)
            for found in bus.scan([unit], protocol="huanyang"):
                yield from self._told_once(Located(settings, unit, None, found.problem, found.protocol))

    def _told_once(self, located: Located) -> Iterator[Located]:
        """*located*, which answers in another protocol, unless it was told at this speed already."""
        self._plan.answered_otherwise()
        key = located.settings.baudrate, located.unit
        if key not in self._otherwise:
            self._otherwise.add(key)
            yield located

    def _asked(self, bus: Bus, settings: Settings, unit: int) -> Located | None:
        """What *unit* says that it is, or how its answers are damaged; None if it is silent."""
        located: Located | None = None
        for _ in range(_TIMES):
            try:
                return Located(settings, unit, bus.identify(unit))
            except (NoAnswer, BadAnswer) as error:
                foreign = speaks_otherwise(unit, error)
                if foreign is not None:
                    return Located(settings, unit, None, foreign, "huanyang")
                if isinstance(error, NoAnswer) or not may_be_of(unit, error.raw):
                    break
                located = Located(settings, unit, None, str(error))
        return located

    def _to_ask(self, bus: Bus) -> Iterator[int]:
        """Those who are to be asked over *bus*, and once more those who made noise where an answer was due.

        At a wrong parity an answer looks like that, so that speed comes next with its other formats.
        """
        asked_again: set[int] = set()
        while True:
            while (unit := self._plan.unit()) is not None:
                yield unit
            again = [unit for unit in noisy(bus.stats()) if unit not in asked_again]
            if not again:
                return
            self._plan.damaged()
            asked_again.update(again)
            yield from again

    def _listen(self, bus: Bus, settings: Settings) -> bool:
        """Whether nothing is heard on *bus* while nobody of ours asks.

        Raises:
            BadAnswer: Whole frames are: another master is there, whose exchanges would be spoilt.
        """
        self._tell(settings, None)
        came = b"".join(piece for _, piece in bus.listen(_LISTEN))
        frames = frames_in(came[:_LONGEST])
        if frames:
            raise BadAnswer(
                f"somebody else asks units of this line: {len(frames)} whole frames came in {_LISTEN:g} s at "
                f"{settings} while nothing was asked, such as {frames[0].hex(' ').upper()}; a line has one master. End "
                "the other one, then search again",
                raw=came,
            )
        return not came

    def _listen_elsewhere(self, noisy: Settings) -> None:
        """Looks for the master whose frames are noise at the settings *noisy*, before anybody is asked anything."""
        self._has_listened = True
        for settings in self._plan.upcoming():
            if settings != noisy:
                try:
                    bus = self._bus_at(settings)
                except PortError:
                    continue
                with bus:
                    self._listen(bus, settings)

    def _opened(self, settings: Settings) -> Bus | None:
        """The line at *settings*; None where the port has others, but not these."""
        try:
            bus = self._bus_at(settings)
        except PortError as error:
            if not self._has_opened:
                raise self._not_to_be_had(error) from error
            # If it is the port that is gone, this says so.
            self._bus_at(self._first).close()
            self._plan.passed_over(str(error))
            return None
        self._has_opened = True
        return bus

    def _bus_at(self, settings: Settings) -> Bus:
        return self._open(
            self._port,
            **vars(settings),
            rs485=self._rs485,
            timeout=self._patience(settings),
            retries=0,
            read_only=True,
            share="never",
        )

    def _not_to_be_had(self, error: PortError) -> PortError:
        """*error*, with why another program that shares the port does not help, where one has it."""
        path = self._port if isinstance(self._port, (str, os.PathLike)) else None
        if path is None or self._fixed or not port_facts.facts(path).holders:
            return error
        why = "A search changes how the port is set, so it cannot go through another program"
        return PortError(f"{error}. {why}", errno=error.errno)

    def _patience(self, settings: Settings) -> float:
        """Seconds that each is given at *settings*."""
        if self._timeout is not None:
            return self._timeout
        timing = settings.timing
        return self._delay + _ADAPTER + timing.t35 + _ANSWER * timing.char_time

    def _tell(self, settings: Settings, unit: int | None) -> None:
        if self._progress is not None:
            self._progress(Progress(settings, unit, self._plan.left()))
