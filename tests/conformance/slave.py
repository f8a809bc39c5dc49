"""A slave of one unit behind a pseudo-terminal: register *a* holds *a* until it is written; writes are remembered.

It answers 03H, 06H, 08H and 10H, in the order it was asked and each at most once, as a unit with one buffer does.
What it does to a certain request is the row's business: a `Behaviour` may lose the request, change its reply, cut it
up, put it off, or hold it back until the next request has come in, so that a late reply is late however fast or slow
the master is. A reply that is held back until a certain register is read lets those to other requests pass; one that is
held back past repeats lets those to the same request pass.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import struct
import termios
import threading
import time
import tty
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from . import wire

UNIT = 1
# Seconds between a late reply or an echo and what follows: more than 3.5 characters at 9600 bit/s and above.
GAP = 0.005


@dataclass
class Reaction:
    """What becomes of one request: pieces of a reply, each with the seconds that pass before it."""

    pieces: Sequence[tuple[float, bytes]] = ()
    lost: bool = False  # the request never reached the unit; it changes nothing there
    held: bool = False  # the reply waits until the next request came, or until `release`
    until: int | None = None  # it waits for a read of this register instead, and is passed by other replies
    past_repeats: bool = False  # it waits for a request that is not this one again


# Given the request, how often the very same one came before, and its ordinary reply. None: nothing unusual.
Behaviour = Callable[[wire.Request, int, bytes], Reaction | None]
Frees = Callable[[wire.Request], bool]  # whether that request lets a held reply go


def ordinary(_request: wire.Request, _before: int, _reply: bytes) -> Reaction | None:
    """Nothing unusual, ever."""
    return None


@dataclass
class Log:
    """What reached the unit, in its own words."""

    requests: list[wire.Request] = field(default_factory=list)
    writes: list[tuple[int, int, int]] = field(default_factory=list)  # unit, address, value

    def written(self, address: int, value: int) -> int:
        """How often *value* was written to *address*."""
        return sum((each[1], each[2]) == (address, value) for each in self.writes)


class Slave:
    """The unit, its pseudo-terminal and the thread that serves both. `port` is a link that survives a `vanish`."""

    def __init__(
        self, folder: Path, behaviour: Behaviour = ordinary, *, mute: bool = False, echo: bool = False
    ) -> None:
        self.port = folder / "port"
        self.log = Log()
        self.behaviour = behaviour
        self.mute = mute  # on 08H, as many devices are
        self.echo = echo  # the adapter hands back what it sends
        self.gap = GAP
        self._registers: dict[int, int] = {}
        self._seen: Counter[wire.Request] = Counter()
        self._held: list[tuple[Frees, bytes]] = []
        self._outbox: deque[tuple[float, bytes]] = deque()
        self._free = 0.0  # when the line is free for the next reply
        self._lock = threading.Lock()
        self._wake, self._waker = os.pipe()
        self._ends: tuple[int, int] | None = None
        self._open = True
        self.appear()
        self._thread = threading.Thread(target=self._serve, name="slave", daemon=True)
        self._thread.start()

    def __enter__(self) -> Slave:
        return self

    def __exit__(self, *_: object) -> None:
        self._open = False
        os.write(self._waker, b"!")
        self._thread.join()
        self.vanish()
        os.close(self._wake)
        os.close(self._waker)

    def appear(self) -> None:
        """Opens a pseudo-terminal, under whatever name the system has for it, and points the link there."""
        ends = os.openpty()
        tty.setraw(ends[1])
        os.set_blocking(ends[0], False)
        name = self.port.with_name("port.new")
        name.symlink_to(os.ttyname(ends[1]))
        name.replace(self.port)
        with self._lock:
            self._ends = ends
        os.write(self._waker, b"!")

    def vanish(self) -> None:
        """Closes both ends, as pulling a USB adapter does."""
        with self._lock:
            ends, self._ends = self._ends, None
            self._outbox.clear()
            self._held.clear()
            self.port.unlink(missing_ok=True)
            if ends:
                os.close(ends[0])
                os.close(ends[1])
        os.write(self._waker, b"!")

    def change(self, address: int, value: int) -> None:
        """Changes a register by the unit's own doing."""
        with self._lock:
            self._registers[address] = value

    def hold_stale(self, address: int) -> None:
        """Owes the reply to a read of *address* that came earlier: it goes out when the next request is in."""
        with self._lock:
            self._held.append((lambda _: True, wire.read_reply(UNIT, [address])))

    def release(self) -> None:
        """Sends what was held back, and returns when the port has it (or a reader was quicker)."""
        with self._lock:
            size = sum(len(reply) for _, reply in self._held)
            ends = self._ends
            self._send_held(None)
        deadline = time.monotonic() + 0.05
        while ends and _queued(ends[1]) < size and time.monotonic() < deadline:
            time.sleep(0.001)

    def settle(self) -> None:
        """Returns when everything that was sent to the unit is in its log."""
        while self._ends and _queued(self._ends[0]):
            time.sleep(0.001)
        with self._lock:
            return

    def _send_held(self, request: wire.Request | None) -> None:
        """Sends those that *request* frees; without one, all."""
        stays = []
        for frees, reply in self._held:
            if request is None or frees(request):
                self._free = max(time.monotonic(), self._free) + self.gap
                self._write(reply)
            else:
                stays.append((frees, reply))
        self._held = stays

    def _write(self, data: bytes) -> None:
        if self._ends:
            with contextlib.suppress(OSError):
                os.write(self._ends[0], data)

    def _serve(self) -> None:
        received = bytearray()
        while self._open:
            with self._lock:
                wait = self._send_due()
                watched = [self._wake, *([self._ends[0]] if self._ends else [])]
            try:
                ready, _, _ = select.select(watched, [], [], wait)
            except OSError:  # `vanish` closed the port since the list was made
                continue
            if self._wake in ready:
                os.read(self._wake, 64)
                received.clear()
                continue
            with self._lock:
                if ready and self._ends and self._ends[0] in ready:
                    try:
                        received += os.read(self._ends[0], 4096)
                    except OSError:
                        continue
                    while request := wire.take(received):
                        self._take(request)

    def _send_due(self) -> float | None:
        """Sends what is due; seconds until more is."""
        now = time.monotonic()
        while self._outbox:
            due, data = self._outbox[0]
            if due > now:
                return due - now
            self._outbox.popleft()
            self._write(data)
        return None

    def _take(self, request: wire.Request) -> None:
        before = self._seen[request]
        self._seen[request] += 1
        self._send_held(request)
        if request.unit not in (0, UNIT):
            return
        reply = self._reply(request)
        reaction = self.behaviour(request, before, reply)
        if self.echo:
            self._write(wire.frame(request.unit, request.pdu))
            self._free = time.monotonic() + self.gap
        if reaction and reaction.lost:
            return
        self._apply(request)
        if request.unit == 0:
            return
        if reaction is None:
            reaction = Reaction([(0.0, b"" if self.mute and request.function == wire.LOOP_BACK else reply)])
        if reaction.held:
            self._held += [(_frees(reaction, request), data) for _, data in reaction.pieces]
            return
        due = max(time.monotonic(), self._free)
        for delay, data in reaction.pieces:
            due += delay
            self._outbox.append((due, data))
        self._free = due

    def _reply(self, request: wire.Request) -> bytes:
        unit, pdu = request.unit, request.pdu
        match request.function:
            case wire.READ if 1 <= request.count <= 125:
                values = [self._registers.get(a, a) for a in range(request.address, request.address + request.count)]
                return wire.read_reply(unit, values)
            case wire.WRITE | wire.WRITE_MANY:
                return wire.frame(unit, pdu[:5])
            case wire.LOOP_BACK:
                return wire.frame(unit, pdu)
            case wire.READ:
                return wire.exception(request, wire.ILLEGAL_VALUE)
        return wire.exception(request, wire.ILLEGAL_FUNCTION)

    def _apply(self, request: wire.Request) -> None:
        self.log.requests.append(request)
        if request.function in (wire.WRITE, wire.WRITE_MANY):
            for offset, value in enumerate(request.values):
                self._registers[request.address + offset] = value
                self.log.writes.append((request.unit, request.address + offset, value))


def _frees(reaction: Reaction, held: wire.Request) -> Frees:
    """What lets the reply to *held* go."""
    if reaction.until is not None:
        until = reaction.until
        return lambda request: request.is_read(until)
    return (lambda request: request != held) if reaction.past_repeats else (lambda _: True)


def _queued(descriptor: int) -> int:
    """Bytes that wait to be read."""
    (size,) = struct.unpack("i", fcntl.ioctl(descriptor, termios.FIONREAD, b"\0" * 4))
    return int(size)
