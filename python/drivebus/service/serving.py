"""Serves the lines of a site until it is told to end: each in a thread of its own, so that none waits for another."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from datetime import datetime, timezone
from typing import Any

from drivebus.bus import Bus
from drivebus.drive import Drive
from drivebus.errors import DrivebusError, NotAllowed
from drivebus.gateway import Allow, Gateway, GatewayStats
from drivebus.latch import Latch
from drivebus.service.events import Events
from drivebus.service.handles import handle_of
from drivebus.service.mistakes import check
from drivebus.service.notify import notify, watchdog_interval
from drivebus.service.orders import Orders
from drivebus.service.outlets import outlets_of
from drivebus.service.plant import Plant
from drivebus.service.polling import Polling
from drivebus.service.status import StatusFile
from drivebus.sinks import GatewayPicture, LinePicture, Picture
from drivebus.site import Site, SiteAllow, SiteDrive, SiteGateway, SiteLine
from drivebus.spool import Spool

__all__ = ["Service"]

_LOOKS = 0.2
"""Seconds between two looks at what happened."""

_AGAIN = 1.0
"""Seconds until a line that could not be opened is tried again."""

_AT_ONCE = 5
"""So much of what clients did wrong is told at a time: whoever floods a gateway shall not flood a log."""


class Service:
    """The service of one site.

    Args:
        site: What it serves.
        tell: Hears in words what people should know, line by line.

    Raises:
        NotAllowed: Something in the file cannot be. Nothing was opened.
    """

    def __init__(self, site: Site, tell: Callable[[str], None]) -> None:
        check(site)
        self._site = site
        self._tell = tell
        self._over = Latch()
        of_line = {
            name: [each for each in site.share.gateways if each.line == line] for name, line in site.lines.items()
        }
        self._spool = _spool_of(site, tell)
        self._events = Events(tell, self._spool)
        self._orders = Orders(site.drives, self._events)
        self._lines = [
            _Served(site, line, of_line[name], tell, self._over, self._spool, self._events, self._orders)
            for name, line in site.lines.items()
        ]
        self._outlets = outlets_of(Plant(site, self.picture, self._spool, self._events, self._orders, tell))

    def run(self, duration: float | None = None) -> None:
        """Serves until `end` is called, or for *duration* seconds. What clients set in motion is halted then."""
        status = StatusFile(self._site)
        threads = [threading.Thread(target=line.run, name=f"line {line.name}") for line in self._lines]
        try:
            for thread in threads:
                thread.start()
            for line in self._lines:
                line.tried.wait()
            for outlet in self._outlets.values():
                outlet.start()
            notify("READY=1")
            self._watch(status, None if duration is None else time.monotonic() + duration)
        finally:
            notify("STOPPING=1")
            self._over.set()
            for thread in threads:
                thread.join()
            for outlet in self._outlets.values():
                outlet.close()
            if self._spool is not None:
                self._spool.close()
            with suppress(OSError):
                status.remove()

    def picture(self) -> Picture:
        """How its lines and drives are now. Any thread."""
        spooled, lost = (0, 0) if self._spool is None else (self._spool.added, self._spool.lost)
        return Picture(time.time(), tuple(line.picture() for line in self._lines), spooled, lost)

    def end(self) -> None:
        """Ends it: `run` returns when all is closed."""
        self._over.set()

    def _watch(self, status: StatusFile, until: float | None) -> None:
        """Says how the service does, and that it lives: as long as each line has given somebody the turn meanwhile."""
        interval, turns, pinged = watchdog_interval(), {line.name: -1 for line in self._lines}, 0.0
        while not self._over.is_set() and (until is None or time.monotonic() < until):
            for outlet in self._outlets.values():
                outlet.turn()
            # A disk that is full ends nobody's service.
            with suppress(OSError):
                status.write(self.status())
            now = {line.name: line.turns for line in self._lines}
            if interval is not None and time.monotonic() >= pinged + interval:
                if all(now[name] != turns[name] for name in now):
                    notify("WATCHDOG=1")
                turns, pinged = now, time.monotonic()
            left = _AGAIN if until is None else min(_AGAIN, max(until - time.monotonic(), 0.0))
            self._over.wait(left if interval is None else min(left, interval / 2))

    def status(self) -> dict[str, Any]:
        """How it does: the time, its process, and of each line what `drivebus serve --status` shows."""
        moment = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        return {
            "time": moment,
            "process": os.getpid(),
            "file": str(self._site.path),
            "lines": {line.name: line.status() for line in self._lines},
            "outlets": {name: outlet.status() for name, outlet in self._outlets.items()},
            "spool": None if self._spool is None else {"last": self._spool.last, "lost": self._spool.lost},
        }


class _Served:
    """One line, opened again and again until the service ends."""

    def __init__(
        self,
        site: Site,
        line: SiteLine,
        gateways: list[SiteGateway],
        tell: Callable[[str], None],
        over: Latch,
        spool: Spool | None,
        events: Events,
        orders: Orders,
    ) -> None:
        self.name = line.name
        self.turns = 0
        """How often the line gave this program the turn, and how often that was tried where it is not there."""
        self.tried = Latch()
        """Closed when it was tried to open it."""
        self._site, self._line, self._told = site, line, gateways
        self._polling = Polling(line, site.polls, spool, events)
        self._tell = tell
        self._events = events
        self._orders = orders
        self._over = over
        self._open: tuple[Bus, list[Gateway]] | None = None
        self._before = (time.monotonic(), 0.0)
        self._why = ""

    def run(self) -> None:
        """Serves it until the service ends. What nobody thought of ends it for all: it is started again."""
        try:
            while not self._over.is_set():
                self._try()
        finally:
            self.tried.set()
            self._over.set()

    def _try(self) -> None:
        try:
            with ExitStack() as stack:
                gateways: list[Gateway] = []
                # Last of all: what becomes of motors at the end is told, too.
                stack.callback(self._tell_of, gateways)
                self._begin(stack, gateways)
                stack.callback(self._close)
                self.tried.set()
                self._serve()
        except (DrivebusError, OSError) as error:
            if str(error) != self._why:
                self._why = str(error)
                self._events.note(self.name, "away", f"{error}; tried again each second")
            self.turns += 1
            self.tried.set()
            self._over.wait(_AGAIN)

    def _begin(self, stack: ExitStack, gateways: list[Gateway]) -> None:
        line = self._line
        share = self._site.share
        # So that a read is asked again within the time that its client waits.
        options: dict[str, Any] = {"learn_timeout": True, "reserved": line.reserved, "realtime": share.realtime}
        options["group"] = share.group
        if line.baud is not None:
            options["baudrate"] = line.baud
        if line.format is not None:
            bits, parity, stop = tuple(line.format)
            options |= {"bytesize": int(bits), "parity": parity, "stopbits": int(stop)}
        if line.rs485 is not None:
            options["rs485"] = {"mode": line.rs485}
        bus = stack.enter_context(Bus(line.port, **options))
        gateways.extend(stack.enter_context(self._gateway(bus, each)) for each in self._told)
        self._polling.begin(bus, stack)
        self._orders.begin(bus, self.name, stack)
        self._open, self._why = (bus, gateways), ""
        at = ", ".join(gateway.address for gateway in gateways)
        self._events.note(self.name, "open", f"{bus.port} is served{f' at {at}' if at else ''}")

    def _gateway(self, bus: Bus, told: SiteGateway) -> Gateway:
        drives: dict[str, Drive] = {}
        allow = [_allowed(bus, each, drives) for each in told.allow]
        audit = self._site.share.audit
        return Gateway(
            bus,
            told.address,
            framing=told.framing,
            answer_within=told.answer_within,
            allow=allow,
            dead_man=told.dead_man,
            audit=audit,
        )

    def _close(self) -> None:
        self._open = None

    def _serve(self) -> None:
        assert self._open is not None
        bus, gateways = self._open
        known: list[str] = []
        while not self._over.is_set():
            self._over.wait(_LOOKS)
            self._tell_of(gateways)
            stats = bus.stats()
            notes = [*stats.notes, *stats.wills]
            for text in notes:
                if text not in known:
                    self._events.note(self.name, "told", text)
            known = notes
            self._polling.check()
            # Nothing is sent: whoever uses the line lets this one have its turn, or hangs.
            with suppress(DrivebusError):
                bus.listen(0.0)
            self.turns += 1

    def _tell_of(self, gateways: list[Gateway]) -> None:
        told = [text for gateway in gateways for text in gateway.told()]
        for text in told[:_AT_ONCE]:
            self._tell(f"{self.name}: {text}")
        if len(told) > _AT_ONCE:
            self._tell(f"{self.name}: and {len(told) - _AT_ONCE} more like these")

    def picture(self) -> LinePicture:
        """How it is now. Any thread."""
        there = self._open
        if there is None:
            return LinePicture(self.name, False, {}, why=self._why)
        bus, gateways = there
        with suppress(DrivebusError):
            stats = bus.stats()
            counts = {name: stats[name] for name in stats if isinstance(stats[name], int | float)}
            asked = tuple(_picture_of(gateway) for gateway in gateways)
            return LinePicture(self.name, True, counts, self._polling.last(), asked, tuple(stats.hints))
        return LinePicture(self.name, False, {})

    def status(self) -> dict[str, Any]:
        """How the line does."""
        if self._open is None:
            return {"port": self._line.port, "open": False, "why": self._why}
        bus, gateways = self._open
        stats = bus.stats()
        (then, before), self._before = self._before, (time.monotonic(), stats.occupied)
        # Opened again meanwhile, it counts from nothing.
        occupied = stats.occupied - before if stats.occupied >= before else stats.occupied
        return {
            "port": bus.port,
            "open": True,
            "occupied": round(min(occupied / max(self._before[0] - then, 1e-9), 1.0), 3),
            "requests": stats.requests,
            "answers": stats.answers,
            "timeouts": stats.timeouts,
            "reconnects": stats.reconnects,
            "hints": stats.hints,
            "drives": self._polling.status(),
            "programs": [program for program in stats.programs if program["here"]],
            "gateways": {
                gateway.address: dict(zip(GatewayStats.__annotations__, gateway.stats, strict=True))
                for gateway in gateways
            },
        }


def _picture_of(gateway: Gateway) -> GatewayPicture:
    stats = gateway.stats
    outcomes = ("answered", "failed", "refused", "late", "given_up", "busy")
    return GatewayPicture(gateway.address, stats.clients, {name: getattr(stats, name) for name in outcomes})


def _spool_of(site: Site, tell: Callable[[str], None]) -> Spool | None:
    """Where samples wait, if there are any."""
    if not site.polls or site.spool is None:
        return None
    try:
        return Spool(site.spool.path, site.spool.size, tell)
    except OSError as error:
        raise NotAllowed(f"the spool {site.spool.path} cannot be opened: {error.strerror or error}") from None


def _allowed(bus: Bus, rule: SiteAllow, drives: dict[str, Drive]) -> Allow:
    writes = bool(rule.write or rule.commands)

    def drive_of(each: SiteDrive) -> Drive | int:
        if not writes:
            return each.unit
        if each.name not in drives:
            drives[each.name] = handle_of(bus, each)
        return drives[each.name]

    return Allow(
        networks=rule.networks,
        drives=[*(drive_of(each) for each in rule.drives), *rule.units],
        functions=rule.functions,
        write=rule.write,
        commands=rule.commands,
    )
