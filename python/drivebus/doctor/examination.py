"""An examination of a port: which step comes after which, and what each finding means for those that follow.

What a step looks for, and the words it says it in, stand in the files that it is taken from.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace

from drivebus import checks
from drivebus.bus import Bus
from drivebus.doctor.adapter import adapter_findings, port_finding
from drivebus.doctor.bus_noise import OTHER_MASTER, UNKNOWN, heard, overheard
from drivebus.doctor.characters import asked_of, of_settings
from drivebus.doctor.findings import Finding
from drivebus.doctor.foreign import is_foreign, of_drive, speaker
from drivebus.doctor.hints import hint_findings
from drivebus.doctor.unit import UnitExamination
from drivebus.doctor.unit_scan import found_elsewhere, look, nobody, units_to_ask, whole
from drivebus.errors import PortError
from drivebus.identify.results import Found
from drivebus.line.addresses import Addresses
from drivebus.line_search.order import candidates
from drivebus.line_search.settings import Settings, can_be_changed
from drivebus.profile import Profile

__all__ = ["Examination", "examine"]

_MOST_UNITS = 8
"""Units that are looked at one by one, unless everything is."""

_EACH = 0.5
"""Seconds to listen for another master at each of the settings where one may be."""

_TIMES = 5
"""How often somebody is asked before it counts that no whole answer comes: a bad line is not a wrong setting."""

_TIMES_ELSEWHERE = 2
"""The same at settings other than the given ones, where mostly nobody answers."""


def examine(
    port: object,
    unit: int | None = None,
    *,
    baudrate: int = 19200,
    parity: str = "E",
    stopbits: int = 1,
    bytesize: int = 8,
    full: bool = False,
    listen: float = 1.0,
    echoes: int = 25,
    rs485: Mapping[str, object] | None = None,
    profile: str | os.PathLike[str] | Profile | None = None,
    unverified: bool = False,
    reserved: bool = False,
    tell: Callable[[str], None] | None = None,
    open: Callable[..., Bus] = Bus,  # noqa: A002 - what it is
) -> Generator[Finding, None, None]:
    """Examines the adapter behind *port*, the line, and *unit* (None: each unit that answers), and yields its findings.

    Takes some seconds where somebody answers at these settings, half a minute where nobody does. Ending the iteration
    closes the port.

    Args:
        port: As for `Bus`.
        unit: 1..247, or another that the line has: see *reserved*.
        baudrate: Bits per second that the line is expected to be set to.
        parity: The same for `"N"`, `"E"` or `"O"`.
        stopbits: The same for 1 or 2.
        bytesize: The same for 7 or 8.
        full: Every address, every baud rate and format, and ten times the echoes.
        listen: Seconds to listen before anything is asked.
        echoes: How many each unit is asked for.
        rs485: As for `Bus`.
        profile: What those units are that do not say it themselves; as for `Bus.drive`.
        unverified: Whether what no document of a family proves is read too.
        reserved: Whether the line has units that the specification reserves, as for `Bus`.
        tell: Is called with what is being done, for whoever watches.
        open: What opens a bus; called as `Bus` is, for each of the settings tried.

    Raises:
        NotAllowed: An argument is wrong.
        PortError: The port was lost meanwhile.
    """
    checks.flag("reserved", reserved)
    if unit is not None:
        Addresses.of(port, reserved=reserved).unit(unit)
    listen = checks.number("listen", listen, 0.0, 3600.0)
    echoes = checks.whole("echoes", echoes, 1, 100_000) * (10 if full else 1)
    named = None if profile is None else Profile.find(profile)
    checks.flag("unverified", unverified)
    checks.flag("full", full)
    examination = Examination(
        port=port,
        unit=unit,
        given=Settings(baudrate, bytesize, parity, stopbits),
        full=full,
        listen=listen,
        echoes=echoes,
        rs485=rs485,
        named=named,
        unverified=unverified,
        reserved=reserved,
        tell=tell or (lambda _: None),
        open=open,
    )
    return examination.findings()


@dataclass(kw_only=True)
class Examination:
    """One examination: its methods are the steps, in the order in which they come, and what they found is kept here.

    Attributes:
        port: As for `Bus`.
        unit: The one that is looked at, 1..247; None for whoever answers.
        given: The settings at which units should answer.
        full: Whether every address and every setting is tried.
        listen: Seconds to listen before anything is asked.
        echoes: How many each unit is asked for.
        rs485: As for `Bus`.
        named: What those units are that do not say it themselves.
        unverified: Whether what no document of a family proves is read too.
        reserved: Whether the line has units that the specification reserves.
        tell: Is called with what is being done.
        open: What opens a bus.
        found: Who answers.
        settings: Those at which they do.
        tried: How many other settings were tried.
        noise: How many bytes came that were no answer.
    """

    port: object
    unit: int | None
    given: Settings
    full: bool
    listen: float
    echoes: int
    rs485: Mapping[str, object] | None
    named: Profile | None
    unverified: bool
    reserved: bool
    tell: Callable[[str], None]
    open: Callable[..., Bus]
    found: list[Found] = field(init=False, default_factory=list)
    settings: Settings = field(init=False)
    tried: int = field(init=False, default=0)
    noise: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        self.settings = self.given

    def findings(self) -> Generator[Finding, None, None]:
        """Yields what is found, from the adapter to the units. Each step that finds the cause of all else is the last.

        Raises:
            PortError: The port was lost meanwhile.
        """
        with ExitStack() as held:
            bus = yield from self._line_to_ask(held)
            if bus is None:
                return
            self._ask(bus)
            likely = units_to_ask(self.unit, False, elsewhere=True)
            cause = None if whole(self.found) else self._sent_otherwise(bus, self.found, likely)
        if cause is None and not whole(self.found):
            cause = yield from self._ask_elsewhere()
        if cause is not None:
            yield cause
            return
        if not self.found:
            yield nobody(self.given, self.unit, units_to_ask(self.unit, self.full), self.tried, self.noise)
            return
        with self._opened(self.settings) as bus:
            yield from self._units(bus)
            yield from hint_findings(bus)

    def _line_to_ask(self, held: ExitStack) -> Generator[Finding, None, Bus | None]:
        """Looks at the adapter and listens. Returns the line, *held* open; None where nothing may be asked on it."""
        self.tell(f"opening at {self.given}")
        try:
            bus = held.enter_context(self._opened(self.given))
        except PortError as error:
            yield port_finding(error)
            return None
        yield from adapter_findings(bus, self.port)
        if bus.format.bytesize != 8:
            yield of_settings(Settings.of(bus))
            if not can_be_changed(self.port):
                return None
            held.close()
            self.settings = self.given = replace(self.given, bytesize=8)
            bus = held.enter_context(self._opened(self.given))
        self.tell(f"listening for {self.listen:g} s")
        traffic = heard(bus, self.listen)
        yield traffic
        if traffic.name == OTHER_MASTER:
            return None
        if traffic.name == UNKNOWN and can_be_changed(self.port):
            held.close()
            other = self._another_master()
            if other is not None:
                yield other
                return None
            bus = held.enter_context(self._opened(self.given))
        return bus

    def _another_master(self) -> Finding | None:
        """Listens for a master at other settings, whose frames look like none here and would be spoilt by asking."""
        for settings in candidates(self.given, self.full):
            self.tell(f"listening at {settings}")
            with suppress(PortError), self._opened(settings) as bus:
                other = overheard(bus, min(self.listen, _EACH))
                if other is not None:
                    return other
        return None

    def _ask(self, bus: Bus) -> None:
        """Finds who answers at the settings given."""
        self.found = look(bus, units_to_ask(self.unit, self.full), self.tell, _TIMES)
        if not self.found and self.unit is None:
            # One question each may have been lost on a bad line: who is likely to be there is asked again.
            likely = units_to_ask(None, self.full, elsewhere=True)
            self.found = [each for unit in likely for each in look(bus, [unit], self.tell, _TIMES)]
        self._count_noise(bus)

    def _sent_otherwise(self, bus: Bus, found: list[Found], likely: Sequence[int]) -> Finding | None:
        """The finding that somebody answers in another way than Modbus RTU on *bus*, where no answer is whole.

        *found* is who answered at all; those that are *likely* there are asked in another protocol.
        """
        for each in filter(is_foreign, found):
            return of_drive(each, Settings.of(bus))
        return asked_of(bus, units_to_ask(self.unit, self.full), self.tell) or speaker(bus, likely, self.tell)

    def _ask_elsewhere(self) -> Generator[Finding, None, Finding | None]:
        """Finds who answers at other settings, where there are any, up to the first at which somebody does.

        Returns the finding that somebody answers there in another way than Modbus RTU.
        """
        for settings in candidates(self.given, self.full) if can_be_changed(self.port) else ():
            better, cause = self._whole_at(settings)
            if cause is not None:
                return cause
            if better:
                if not self._answers_after_all(better[0].unit):
                    self.settings = settings
                    yield found_elsewhere(self.given, settings, better)
                self.found = better
                break
        return None

    def _whole_at(self, settings: Settings) -> tuple[list[Found], Finding | None]:
        """Who gives a whole answer at *settings*, and else the finding that somebody answers in another way."""
        try:
            bus = self._opened(settings)
        except PortError:  # its driver does not make this speed, or not this format
            return [], None
        self.tried += 1
        with bus:
            found = look(bus, units_to_ask(self.unit, self.full, elsewhere=True), self.tell, _TIMES_ELSEWHERE)
            self._count_noise(bus)
            answered = whole(found)
            # Each costs a time-out at each setting, and such a drive has the address 1 from the factory.
            likely = units_to_ask(self.unit, False, elsewhere=True)[:1]
            return answered, None if answered else self._sent_otherwise(bus, found, likely)

    def _answers_after_all(self, unit: int) -> bool:
        """Whether *unit*, which answers elsewhere, does so at the settings given too: then the line is bad."""
        with self._opened(self.given) as bus:
            return bool(whole(look(bus, [unit], self.tell, _TIMES)))

    def _units(self, bus: Bus) -> Iterator[Finding]:
        """Looks at those that were found, one by one."""
        for each in self.found if self.full else self.found[:_MOST_UNITS]:
            if is_foreign(each):
                yield of_drive(each, self.settings)
                continue
            unit = UnitExamination(bus, each, self.echoes, self.tell, self.named, self.unverified)
            yield from unit.findings()

    def _opened(self, settings: Settings) -> Bus:
        """The line at *settings*, for reading only, and to itself: its figures tell of nobody else's requests."""
        how = {"rs485": self.rs485, "read_only": True, "share": "never", "reserved": self.reserved}
        return self.open(self.port, **vars(settings), **how)

    def _count_noise(self, bus: Bus) -> None:
        self.noise += int(bus.stats()["noise_bytes"])
