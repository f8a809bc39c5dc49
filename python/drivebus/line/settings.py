"""What is opened as a bus, and what every bus tells of itself without asking the line, however it is waited for."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Protocol

from drivebus import _native, checks
from drivebus._native import SerialFormat
from drivebus.advice import Text, argument
from drivebus.errors import BadArgument
from drivebus.line import port_urls
from drivebus.line.addresses import Addresses
from drivebus.line.trace import Trace
from drivebus.line.units import Units
from drivebus.strict_attributes import known_keywords

if TYPE_CHECKING:
    from drivebus.line.pcapng_trace import WireFile
    from drivebus.line.stats import Stats
    from drivebus.sim import Simulator

__all__ = ["BusFace", "Opening", "check_trust"]


class Opening:
    """The arguments of a bus, checked, and its port as the core takes it. Nothing is opened yet but a simulator.

    Attributes:
        target: What the core opens.
        format: How its characters look.
        keywords: What else the core is told.
        simulator: The simulator behind it, if there is one.
        owned: What was made here, and ends with the bus.
        known: What is known of its units.
        trace: Who watches its frames.
        shown: What was given as its port, for people.
    """

    def __init__(
        self,
        port: object,
        line: SerialFormat,
        *,
        timeout: float,
        retries: int,
        read_only: bool,
        rs485: Mapping[str, object] | None,
        echo: str,
        turnaround: float,
        learn_timeout: bool,
        low_latency: bool,
        queue: int,
        share: str,
        group: str | int | None,
        realtime: bool,
        reserved: bool,
        trace: object,
    ) -> None:
        self.timeout = checks.number("timeout", timeout, 0.0, 3600.0, above=True)
        if rs485 is not None and not isinstance(rs485, Mapping):
            raise BadArgument(
                f'rs485 is {checks.shown(rs485)}, not a mapping; give one such as {{"mode": "kernel"}}, or None'
            )
        self.keywords: dict[str, Any] = {
            "timeout": self.timeout,
            "retries": checks.whole("retries", retries, 0, 100),
            "read_only": checks.flag("read_only", read_only),
            "rs485": None if rs485 is None else dict(rs485),
            "echo": checks.one_of("echo", echo, ("auto", "yes", "no")),
            "turnaround": checks.number("turnaround", turnaround, 0.0, 3600.0),
            "learn_timeout": checks.flag("learn_timeout", learn_timeout),
            "low_latency": checks.flag("low_latency", low_latency),
            "queue": checks.whole("queue", queue, 1, 1_000_000),
            "share": checks.one_of("share", share, ("auto", "own", "never")),
            "group": _group_number(group),
            "realtime": checks.flag("realtime", realtime),
        }
        _check_together(port, self.keywords)
        target = port_urls.resolve(port, line)
        self.format = port_urls.format_of(target, line)
        self.simulator = port_urls.as_simulator(target)
        self.owned = target if target is not port and not isinstance(target, str) else None
        if self.simulator is not None:
            target = _line_of(self.simulator)
        self.target = target
        self.known = Units(Addresses.of(target, reserved=checks.flag("reserved", reserved)))
        self.shown = str(port)
        self.trace = Trace(self.known, None if trace is None else _wire_file(trace, self.shown, self.format))

    def close(self) -> None:
        """Ends what was made here: the bus is closed, or was never opened."""
        self.trace.end()
        if self.owned is not None:
            self.owned.close()


def check_trust(profile: object, trust: object) -> None:
    """Refuses trust in a *profile* that was not named: what the drive says it is, it cannot contradict."""
    if checks.flag("trust_profile", trust) and profile is None:
        raise BadArgument(Text("trust_profile needs a profile: give ", argument("profile"), " too"))


def _line_of(simulator: Simulator) -> object:
    from drivebus.sim import core_of, lasting_port

    return core_of(simulator) if simulator.transport == "process" else lasting_port(simulator)


def _group_number(group: object) -> int | None:
    """The number by which the system knows a group."""
    if group is None:
        return None
    if sys.platform == "win32":
        raise BadArgument("group: programs of several users share a port over Unix sockets, which this system has not")
    import grp

    try:
        known = grp.getgrgid(group) if isinstance(group, int) else grp.getgrnam(str(group))
    except (KeyError, OverflowError, ValueError):
        raise BadArgument(f"group {checks.shown(group)} is none of this system; `getent group` lists them") from None
    return known.gr_gid


def _wire_file(path: object, port: str, line: SerialFormat) -> WireFile:
    from drivebus.line.pcapng_trace import WireFile

    return WireFile(path, port, line)


def _check_together(port: object, keywords: Mapping[str, Any]) -> None:
    """Refuses what cannot be meant of *port*, before it is resolved: that opens URLs of pyserial and simulators."""
    named = os.fspath(port) if isinstance(port, (str, os.PathLike)) else None
    name = named if isinstance(named, str) else None
    _native.check_port_options(name, keywords["rs485"] is not None, keywords["echo"])


class _Native(Protocol):
    """What the core tells at once."""

    @property
    def port(self) -> str: ...
    @property
    def closed(self) -> bool: ...
    @property
    def read_only(self) -> bool: ...
    @property
    def reconnects(self) -> int: ...
    def watch(self, function: Callable[[float, float | None, bool, bytes, bool], object] | None, /) -> None: ...
    def step_aside(self, meanwhile: Callable[[], object], /) -> None: ...
    def now(self) -> float: ...
    def stats(self) -> dict[str, Any]: ...
    def configure(self, unit: int, /, *, timeout: float | None = None, gap: float | None = None) -> None: ...


class BusFace:
    """A bus, as far as it tells and is told without a word on the line; and its keywords, which both faces have.

    Attributes:
        simulator: The simulator behind a `sim://` port or the one that was given; None on a real line.
        format: The `SerialFormat` in force.
    """

    simulator: Simulator | None
    format: SerialFormat

    @known_keywords
    def __init__(
        self,
        port: object,
        *,
        baudrate: int = 19200,
        parity: str = "E",
        stopbits: int = 1,
        bytesize: int = 8,
        silence: str | float = "spec",
        timeout: float = 0.5,
        retries: int = 2,
        read_only: bool = False,
        rs485: Mapping[str, object] | None = None,
        echo: str = "auto",
        turnaround: float = 0.1,
        learn_timeout: bool = False,
        low_latency: bool = True,
        queue: int = 65_536,
        share: str = "auto",
        group: str | int | None = None,
        realtime: bool = False,
        reserved: bool = False,
        trace: str | os.PathLike[str] | None = None,
    ) -> None:
        opening = Opening(
            port,
            SerialFormat(baudrate, parity, stopbits, bytesize, silence),
            timeout=timeout,
            retries=retries,
            read_only=read_only,
            rs485=rs485,
            echo=echo,
            turnaround=turnaround,
            learn_timeout=learn_timeout,
            low_latency=low_latency,
            queue=queue,
            share=share,
            group=group,
            realtime=realtime,
            reserved=reserved,
            trace=trace,
        )
        self.simulator = opening.simulator
        self.format = opening.format
        self._timeout = opening.timeout
        self._trace = opening.trace
        self._addresses = opening.known.addresses
        self._begin(opening)

    def _begin(self, opening: Opening) -> None:
        """Opens it, where that is done at once."""
        raise NotImplementedError

    def _core(self) -> _Native:
        """The bus of the core. Raises `PortError` where it is not open yet."""
        raise NotImplementedError

    @property
    def port(self) -> str:
        """The name of the port, for messages."""
        return self._core().port

    @property
    def closed(self) -> bool:
        """Whether `close` was called; in a forked child True, for the line is its parent's."""
        return self._core().closed

    def step_aside(self, meanwhile: Callable[[], object]) -> None:
        """Gives the port up while *meanwhile* runs: another program that shares it has it, and serves the others.

        For a program that is about to be held, as by Ctrl-Z: through one that is held nobody could stop a motor. The
        commands of drivebus do it by themselves. The exchange under way is waited for, two seconds at most; after that
        the port is kept. Nothing is asked over this bus meanwhile, by any thread. What is asked next opens the port
        again, or goes through the program that has it; `reconnects` rises by one.
        """
        self._core().step_aside(meanwhile)

    @property
    def read_only(self) -> bool:
        """Whether every write is refused."""
        return self._core().read_only

    @property
    def timeout(self) -> float:
        """Seconds a unit is given to answer."""
        self._core()
        return self._timeout

    def __repr__(self) -> str:
        return f"<Bus on {self.port}{', closed' if self.closed else ''}>"

    def now(self) -> float:
        """Seconds on the line's clock: real time, or the simulation's."""
        return self._core().now()

    def configure(self, unit: int, *, timeout: float | None = None, gap: float | None = None) -> None:
        """Sets what *unit* needs otherwise than the bus, for every call from now on. None keeps what the bus has.

        Args:
            unit: Its address, 1..247.
            timeout: Seconds it is given to answer.
            gap: Seconds of silence before a request to it, where it needs more than the silence between frames: some
                units are deaf for a while after they answered.
        """
        if timeout is not None:
            timeout = checks.number("timeout", timeout, 0.0, 3600.0, above=True)
        if gap is not None:
            gap = checks.number("gap", gap, 0.0, 3600.0)
        self._core().configure(self._addresses.unit(unit), timeout=timeout, gap=gap)

    def trace(self, on: bool = True) -> None:
        """Logs each frame on the line from now on: time, gap, direction, bytes and what they mean.

        Records go to the logger `drivebus.wire` with level DEBUG. A bus that is opened while that logger is enabled for
        DEBUG logs from its beginning. Each record has the attributes `line_time` (seconds on the line's clock), `gap`
        (seconds since the end of what went before, or None), `sent` (False: heard), `frame` (bytes), `meaning` (text)
        and `elsewhere` (another program has the port: see docs/sharing.md). Whoever handles a record keeps the line
        waiting meanwhile.

        Args:
            on: False ends it.
        """
        self._core()
        self._trace.switch(checks.flag("on", on))

    @property
    def reconnects(self) -> int:
        """How often the port was opened again after it was lost. Another drive may answer behind it.

        Nobody is asked. Another program that has the port says so with each answer, and when it opens it again.
        """
        return self._core().reconnects

    def stats(self) -> Stats:
        """Counters and latencies since the bus was opened, for the line and (in `units`) for each unit.

        `hints` says in words what the figures most likely mean and what to do; it is empty for a sound line.
        `wills` says what this bus did for programs that are gone, such as to halt what one of them ran.

        Where another program has the port, it is asked, and waited for, a second at most: an event loop stands still
        meanwhile.
        """
        from drivebus.line.stats import Stats

        return Stats(self._core().stats())
