"""What is wrong with an adapter, a line and its units: looked at in that order, and said in words.

Sends reads and echoes, never a write: every bus is opened read-only. Each finding comes as soon as it is known.

    for finding in drivebus.doctor.examine("/dev/ttyUSB0"):
        print(finding.severity, finding)
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import ExitStack, suppress
from typing import Any

from drivebus import checks
from drivebus.bus import Bus
from drivebus.doctor.adapter import adapter_findings, port_finding
from drivebus.doctor.findings import Finding, Severity
from drivebus.doctor.search import Settings, candidates, found_elsewhere, look, nobody, units_to_ask
from drivebus.doctor.traffic import OTHER_MASTER, UNKNOWN, heard_findings, overheard
from drivebus.doctor.unit import unit_findings
from drivebus.errors import BadAnswer, NoAnswer, PortError
from drivebus.identify.results import Found
from drivebus.profile import Profile
from drivebus.sim import Simulator

__all__ = ["Finding", "Severity", "examine"]

_MOST_UNITS = 8
"""Units that are looked at one by one, unless everything is."""

_EACH = 0.5
"""Seconds to listen for another master at each of the settings where one may be."""

_TIMES = 5
"""How often somebody is asked before it counts that no whole answer comes: a bad line is not a wrong setting."""

_HINTS: Mapping[str, tuple[Severity, type[BadAnswer | NoAnswer] | None]] = {
    "no_bias": (Severity.WARNING, BadAnswer),
    "interference": (Severity.WARNING, BadAnswer),
    "other_master": (Severity.FAULT, BadAnswer),
    "timeout_too_short": (Severity.WARNING, NoAnswer),
    "adapter_echo": (Severity.NOTE, None),
}
"""Hints of `Bus.stats` that say more than what was found otherwise. Silence and damage are counted by unit."""


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
    tell: Callable[[str], None] | None = None,
    open: Callable[..., Bus] = Bus,  # noqa: A002 - what it is
) -> Generator[Finding, None, None]:
    """Looks at the adapter behind *port*, the line, and *unit* (None: whoever answers), and yields what it finds.

    Takes some seconds where somebody answers at these settings, half a minute where nobody does. Ending the iteration
    closes the port.

    Args:
        port: As for `Bus`.
        unit: 1..247.
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
        tell: Is called with what is being done, for whoever watches.
        open: What opens a bus; called as `Bus` is, for each of the settings tried.

    Raises:
        NotAllowed: An argument is wrong.
        PortError: The port was lost meanwhile.
    """
    if unit is not None:
        checks.unit(unit)
    listen = checks.number("listen", listen, 0.0, 3600.0)
    echoes = checks.whole("echoes", echoes, 1, 100_000) * (10 if full else 1)
    named = None if profile is None else Profile.find(profile)
    say = tell or (lambda _: None)
    checks.flag("unverified", unverified)
    checks.flag("full", full)

    def about(bus: Bus, found: Found) -> Iterator[Finding]:
        return unit_findings(bus, found, echoes, say, named, unverified)

    def opened(settings: Settings) -> Bus:
        options: dict[str, Any] = {**vars(settings), "rs485": rs485, "read_only": True}
        return open(port, **options)

    given = Settings(baudrate, bytesize, parity, stopbits)
    return _examine(port, unit, given, full, listen, about, say, opened, _has_settings(port))


def _has_settings(port: object) -> bool:
    """Whether another baud rate can be tried on *port*: not behind a server, nor on what is open already."""
    if isinstance(port, str):
        return not port.startswith(("socket://", "tcp://"))
    return isinstance(port, (os.PathLike, Simulator))


def _examine(
    port: object,
    unit: int | None,
    given: Settings,
    full: bool,
    listen: float,
    about: Callable[[Bus, Found], Iterator[Finding]],
    tell: Callable[[str], None],
    opened: Callable[[Settings], Bus],
    tries_settings: bool,
) -> Generator[Finding, None, None]:
    tell(f"opening at {given}")
    try:
        bus = opened(given)
    except PortError as error:
        yield port_finding(error)
        return
    with ExitStack() as held:
        held.enter_context(bus)
        yield from adapter_findings(bus, port)
        tell(f"listening for {listen:g} s")
        heard = ""
        for finding in heard_findings(bus, listen):
            heard = finding.name
            yield finding
        if heard == UNKNOWN and tries_settings:
            held.close()
            other = _another_master(opened, given, full, listen, tell)
            if other is not None:
                yield other
                return
            bus = held.enter_context(opened(given))
        if heard == OTHER_MASTER:
            return
        asked = units_to_ask(unit, full)
        found = look(bus, asked, tell, _TIMES)
        if not found and unit is None:
            # One question each may have been lost on a bad line: who is likely to be there is asked again.
            found = [each for likely in units_to_ask(None, full, True) for each in look(bus, [likely], tell, _TIMES)]
        noise = _noise(bus)
    settings = given
    if not _whole(found):
        tried = 0
        for settings in candidates(given, full) if tries_settings else ():
            try:
                bus = opened(settings)
            except PortError:  # its driver does not make this speed, or not this format
                continue
            tried += 1
            with bus:
                better = _whole(look(bus, units_to_ask(unit, full, True), tell, 2))
                noise += _noise(bus)
            if better and not _answers_after_all(opened, given, better, tell):
                yield found_elsewhere(given, settings, better)
                found = better
                break
            if better:
                settings, found = given, better
                break
        else:
            settings = given
        if not found:
            yield nobody(given, unit, asked, tried, noise)
            return
    with opened(settings) as bus:
        for each in found if full else found[:_MOST_UNITS]:
            yield from about(bus, each)
        yield from _hints(bus)


def _another_master(
    opened: Callable[[Settings], Bus], given: Settings, full: bool, listen: float, tell: Callable[[str], None]
) -> Finding | None:
    """What makes no frame may be a master at other settings, whose frames must not be spoilt by asking."""
    for settings in candidates(given, full):
        tell(f"listening at {settings}")
        with suppress(PortError), opened(settings) as bus:
            other = overheard(bus, min(listen, _EACH))
            if other is not None:
                return other
    return None


def _whole(found: list[Found]) -> list[Found]:
    """Those whose answer was whole."""
    return [each for each in found if each.problem is None]


def _answers_after_all(
    opened: Callable[[Settings], Bus], given: Settings, better: list[Found], tell: Callable[[str], None]
) -> bool:
    """Whether who answered at other settings does so at the *given* ones too, if asked again: then the line is bad."""
    with opened(given) as bus:
        return bool(_whole(look(bus, [better[0].unit], tell, _TIMES)))


def _noise(bus: Bus) -> int:
    stats = bus.stats()
    return int(stats["noise_bytes"])


def _hints(bus: Bus) -> Iterator[Finding]:
    """What the figures of all that was asked most likely mean."""
    stats = bus.stats()
    for name, text in zip(stats["hint_names"], stats["hints"], strict=True):
        if name in _HINTS:
            severity, error = _HINTS[name]
            yield Finding("line", name, severity, text.removeprefix("line: "), error=error)
