"""Hears a port that others use, and yields what they say."""

from __future__ import annotations

import math
import os
import queue
import threading
from collections.abc import Callable, Generator
from contextlib import closing
from time import time

from drivebus import _native, checks
from drivebus.bus import Bus
from drivebus.errors import PortError
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.families import Families, Given
from drivebus.sniffer.pairing import Pairing

__all__ = ["heard", "sniff"]

_LONGEST = 31_536_000.0

_LOOK_UP = 0.2
"""Seconds after which a listener looks up: Python runs signal handlers between two waits."""


def sniff(
    port: str | os.PathLike[str] | Bus,
    *,
    baudrate: int = 19200,
    parity: str = "E",
    stopbits: int = 1,
    bytesize: int = 8,
    profiles: Given | Families = None,
    duration: float | None = None,
    tap: Callable[[float, bytes], object] | None = None,
    stop: threading.Event | None = None,
) -> Generator[Exchange, None, None]:
    """Listens on *port* and yields each exchange as it is heard. Nothing is sent, ever.

        for exchange in drivebus.sniff("/dev/ttyUSB0", baudrate=9600, parity="N"):
            print(exchange.unit, exchange.values, exchange.error)

    Who asks and who answers is worked out of the frames themselves. What cannot be told is said so: see
    `Exchange.error`. Where another program of this user has the port, or this one as a bus, all that goes over it is
    heard too, what they ask included. Ends after *duration*, or by *stop*, with all that was heard until then; who
    closes the generator, or leaves it by Ctrl-C, is not told what was still waiting for the frame behind it.

    Args:
        port: As `Bus` takes it, or a bus that is open, which is listened to with its own settings.
        baudrate: Bits per second.
        parity: `"N"`, `"E"` or `"O"`.
        stopbits: 1 or 2.
        bytesize: 7 or 8.
        profiles: What a unit's words mean: a profile for each unit by its address, one for all, or None, which takes
            what the units tell and guesses otherwise; see `Families`.
        duration: Seconds to listen; None listens on.
        tap: Is called with each piece as it comes: Unix time in seconds, and the bytes as they were handed over.
        stop: Ends it within 0.2 s when it is set, by another thread or a signal handler.

    Raises:
        NotAllowed: An argument is wrong.
        PortError: The port is not there, busy or not permitted, or was lost.
    """
    limit = math.inf if duration is None else checks.number("duration", duration, 0.0, _LONGEST)
    families = profiles if isinstance(profiles, Families) else Families(profiles)
    bus = port if isinstance(port, Bus) else None
    own = None
    if bus is None:
        bus = own = Bus(port, baudrate=baudrate, parity=parity, stopbits=stopbits, bytesize=bytesize, read_only=True)
    return _exchanges(bus, own, families, limit, tap, threading.Event() if stop is None else stop)


def _exchanges(
    bus: Bus,
    own: Bus | None,
    families: Families,
    limit: float,
    tap: Callable[[float, bytes], object] | None,
    stop: threading.Event,
) -> Generator[Exchange, None, None]:
    began = bus.now()
    ahead = time() - began
    pairing = Pairing(bus.format, families, ahead)
    try:
        with closing(heard(bus, lambda: stop.is_set() or bus.now() - began >= limit)) as pieces:
            for at, data in pieces:
                if tap is not None and data:
                    tap(at + ahead, data)
                yield from pairing.receive(at, data)
        yield from pairing.finish()
    finally:
        if own is not None:
            own.close()


def heard(bus: Bus, is_over: Callable[[], bool]) -> Generator[tuple[float, bytes], None, None]:
    """All that goes over the line of *bus*, as it comes, until *is_over*: moments on the line's clock, and bytes.

    No bytes where only time has passed. A thread of its own hears it, so that nobody who takes his time is missed; what
    it has heard by then is yielded after *is_over*, too.

    Raises:
        PortError: The line was lost.
    """
    pieces: queue.SimpleQueue[tuple[float, bytes] | BaseException | None] = queue.SimpleQueue()
    enough = threading.Event()
    core = bus.line
    assert isinstance(core, _native.Bus)

    def put(at: float, _sent: bool, data: bytes) -> bool:
        pieces.put((at, data))
        return enough.is_set()

    def hear() -> None:
        try:
            core.overhear(put)
            pieces.put(None)
        except BaseException as error:
            pieces.put(error)

    thread = threading.Thread(target=hear, name="drivebus sniff", daemon=True)
    thread.start()
    try:
        while True:
            if not enough.is_set() and is_over():
                enough.set()
                thread.join()
            try:
                piece = pieces.get(timeout=_LOOK_UP)
            except queue.Empty:
                continue
            if piece is None:
                return
            if isinstance(piece, BaseException):
                if bus.closed and isinstance(piece, PortError):
                    return
                raise piece
            yield piece
    finally:
        enough.set()
        thread.join()
