"""A line with units on it: reads, writes, and everything else a master may ask.

The work is done in the compiled core, without the GIL. This module checks arguments, finds out who is there, and opens
what people type as a port.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any

from drivebus import _native, checks, ports
from drivebus._native import SerialFormat
from drivebus.drive import Drive
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed, Refused
from drivebus.poll import Poll, Sample
from drivebus.profile import Profile, identify, profiles
from drivebus.sim import Simulator
from drivebus.values import Found, Link, Stats

__all__ = ["Bus"]

_IDENTIFICATION = "identification_code"
_SCAN_TIMEOUT = 0.1
"""Seconds a unit is given in a scan: over ten times the factory response delay, and 247 units in half a minute."""


class Bus:
    """One line, opened at once. Safe from any thread; requests of several threads take turns.

    Args:
        port: A path (`/dev/ttyUSB0`, `COM3`), `sim://gd350`, `sim://1=gd350,2=gd350?clock=virtual&seed=1`,
            `socket://host:port` (RTU over TCP), `tcp://host:502` (Modbus TCP), any other pyserial URL, a
            `drivebus.sim.Simulator`, or an open `serial.Serial`, which keeps its own settings.
        baudrate: Bits per second.
        parity: `"N"`, `"E"` or `"O"`.
        stopbits: 1 or 2.
        bytesize: 7 or 8.
        silence: `"spec"`, `"characters"` or seconds; see `drivebus.SerialFormat`.
        timeout: Seconds to wait for an answer after the request has left.
        retries: How often a *read* is repeated after silence; a damaged answer, which took no time-out, counts half.
            Writes are never repeated, unless they can be read back: see `write`.
        read_only: Refuse every write before it is sent.
        rs485: Direction control, for ports wired to a bare transceiver: `{"mode": "kernel"}` by the driver, `"rts"` by
            this program, `"auto"` by whichever can; with `rts_on_send`, `delay_before_ms`, `delay_after_ms`.
        echo: Whether the adapter hands back what it sends: `"auto"`, `"yes"` or `"no"`.
        turnaround: Seconds that units are given to act on a broadcast; nothing is sent meanwhile.
        learn_timeout: Give a unit that is read no longer than its answers have taught: four times the longest delay of
            its last 32 answers, at least 50 ms, beside the time the characters take; never longer than *timeout*. The
            next read after silence waits the whole *timeout* again. What `poll` asks waits so in any case.
        low_latency: Whether an adapter that keeps what it receives (FTDI: 16 ms) is told to hurry while it is open.

    Raises:
        NotAllowed: An argument is wrong; nothing was opened.
        PortError: The port is not there, busy, or not permitted.

    Attributes:
        simulator: The simulator behind a `sim://` port or the one that was given; None on a real line.
        format: The `SerialFormat` in force.
    """

    simulator: Simulator | None
    format: SerialFormat

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
    ) -> None:
        turnaround = checks.number("turnaround", turnaround, 0.0, 3600.0)
        timeout = checks.number("timeout", timeout, 0.0, 3600.0, above=True)
        retries = checks.whole("retries", retries, 0, 100)
        if rs485 is not None and not isinstance(rs485, Mapping):
            raise NotAllowed(f'rs485 {rs485!r} is no mapping; give one such as {{"mode": "kernel"}}, or None')
        asked = SerialFormat(baudrate, parity, stopbits, bytesize, silence)
        target = ports.resolve(port, asked)
        self.format = ports.format_of(target, asked)
        self.simulator = target if isinstance(target, Simulator) else None
        self._owned = target if target is not port and not isinstance(target, str) else None
        if isinstance(target, Simulator):
            target = target._native if target.transport == "process" else target.port
        self._native = _native.Bus(
            target,
            self.format,
            timeout=timeout,
            retries=retries,
            read_only=read_only,
            rs485=None if rs485 is None else dict(rs485),
            echo=echo,
            turnaround=turnaround,
            learn_timeout=learn_timeout,
            low_latency=low_latency,
        )
        self._timeout = timeout

    @property
    def port(self) -> str:
        """What was opened, for people."""
        return self._native.port

    @property
    def closed(self) -> bool:
        """Whether `close` was called; in a forked child True, for the line is its parent's."""
        return self._native.closed

    @property
    def read_only(self) -> bool:
        """Whether every write is refused."""
        return self._native.read_only

    @property
    def timeout(self) -> float:
        """Seconds a unit is given to answer."""
        return self._timeout

    def close(self) -> None:
        """Closes the port, and ends a simulator that this bus made. Closing again does nothing.

        An open `serial.Serial` that was given stays open: it is its owner's.
        """
        self._native.close()
        if self._owned is not None:
            self._owned.close()

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Bus on {self.port}{', closed' if self.closed else ''}>"

    def now(self) -> float:
        """Seconds on the line's clock: real time, or the simulation's."""
        return self._native.now()

    def sleep(self, seconds: float, /) -> None:
        """Waits on the line's clock. Ctrl-C ends it at once."""
        self._native.sleep(checks.number("seconds", seconds, 0.0))

    def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """What comes within *seconds* while nothing is asked: pieces, each with its moment on the line's clock.

        On a sound line of one's own that is nothing. Requests of other threads go before, within 50 ms; their answers
        are theirs.
        """
        return self._native.listen(checks.number("seconds", seconds, 0.0))

    def read(self, unit: int, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False) -> list[int]:
        """Reads *count* words (1..125) of *unit* (1..247) from *address* (0..0xFFFF): function 03H.

        Drives allow fewer words than the protocol (INVT: 16) and refuse more themselves.

        An *urgent* read overtakes all who wait: for confirming a stop. With *verify* it is asked until the same words
        came twice in a row: against noise that happens to match its CRC, as one damaged answer in 65 536 does.

        Raises:
            NoAnswer, BadAnswer: After the bus's retries; with *verify*, also where the words change all the time.
            PortError: The port is lost, or the bus closed.
            Refused: The unit says no. What its code means in this family, only a `Drive` knows.
        """
        unit, address, count = checks.unit(unit), checks.address(address), checks.whole("count", count, 1, 125)
        return self._native.read(unit, address, count, urgent=urgent, verify=verify)

    def read_stamped(
        self, unit: int, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False
    ) -> tuple[list[int], float, float]:
        """As `read`, with the Unix times at which the request left and at which the answer was complete."""
        unit, address, count = checks.unit(unit), checks.address(address), checks.whole("count", count, 1, 125)
        return self._native.read_stamped(unit, address, count, urgent=urgent, verify=verify)

    def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
    ) -> None:
        """Writes one word (an int: 06H) or 1..123 words (a sequence: 10H) of 0..0xFFFF. Sent once, never repeated.

        Nothing here asks what stands at *address*: a word in a command register moves the motor.

        A unit that may still owe another answer is first asked for an echo, or for a read that cannot be mistaken; if
        it answers neither, the write is not sent. An *urgent* write does without it and overtakes all who wait: that is
        for a stop, which a drive may hear although nothing is heard of it. Its confirmation may belong to the very same
        write, sent before.

        With *read_back*, the address at which the same words can be read, a confirmation that is missing is looked for
        there, and the write is repeated (the bus's retries) only while the unit shows other words. That is for absolute
        values such as a setpoint; what a command did, nobody can read back.

        With *connection*, the `reconnects` at which you saw who answers, nothing is sent where the port was opened
        again since, for another unit may have the address now: `PortError`, whose `started` is None.

        Raises:
            NotAllowed: An argument is out of range, or the bus is read-only. Nothing was sent.
            NoAnswer, BadAnswer, PortError: The unit may have taken it all the same, unless the error's `started` is
                None: then it was not sent.
            Refused: The unit did not take it.
            Unconfirmed: With *read_back*: the unit shows other words, however often it was written.
        """
        if read_back is not None:
            read_back = checks.whole("read_back", read_back, 0, 0xFFFF, hexadecimal=True)
        if connection is not None:
            connection = checks.whole("connection", connection, 0, 2**63)
        unit, address, words = checks.unit(unit), checks.address(address), checks.payload(value)
        self._native.write(unit, address, words, urgent=urgent, read_back=read_back, connection=connection)

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
        self._native.configure(checks.unit(unit), timeout=timeout, gap=gap)

    def link(self, unit: int) -> Link:
        """How well *unit* could be reached: of its last exchanges, ten at most, how many brought an answer."""
        return Link(*self._native.link(checks.unit(unit)))

    @property
    def reconnects(self) -> int:
        """How often the port was opened again after it was lost. Another drive may answer behind it."""
        return self._native.reconnects

    def broadcast(self, address: int, value: int | Sequence[int]) -> None:
        """Writes to every unit at once; none answers. Returns after the turnaround delay. Sent once."""
        self._native.broadcast(checks.address(address), checks.payload(value))

    def echo(self, unit: int, word: int | None = None) -> float:
        """Asks *unit* to send *word* (0..0xFFFF, random if None) back: 08H/0000. Returns the round trip in seconds."""
        if word is not None:
            word = checks.whole("word", word, 0, 0xFFFF, hexadecimal=True)
        return self._native.echo(checks.unit(unit), word)

    def transact(self, unit: int, pdu: bytes | bytearray | memoryview, reply_length: int | None = None) -> bytes:
        """Sends any PDU (1..253 bytes) and returns the answer's PDU; unit and CRC are added and checked. Sent once.

        *reply_length* is the length of the answer's PDU in bytes; without it, the end is found by function or silence.
        """
        try:
            body = bytes(memoryview(pdu))
        except TypeError:
            raise NotAllowed(f"PDU {pdu!r} is not bytes; give 1..253 bytes, function code first") from None
        if not 1 <= len(body) <= 253:
            raise NotAllowed(f"a PDU of {len(body)} bytes is not allowed; give 1..253 bytes, function code first")
        if reply_length is not None:
            reply_length = checks.whole("reply_length", reply_length, 1, 253)
        return self._native.transact(checks.unit(unit), body, reply_length)

    def scan(self, units: Iterable[int] = range(1, 248), timeout: float | None = None) -> Iterator[Found]:
        """Asks each of *units* who it is, and yields those that answer as they do.

        One read of the identification register each, not repeated. A unit that refuses has answered too, and so has one
        whose answer is damaged: its `problem` says how (often two units with one address, or a wrong parity).

        Args:
            units: Addresses, 1..247.
            timeout: Seconds each is given; None is 0.1 s, or the bus's own time-out if that is shorter.
        """
        if not isinstance(units, Iterable):
            raise NotAllowed(f"units {units!r} are no units; give several of 1..247, such as range(1, 248) or [5]")
        wanted = [checks.unit(unit) for unit in units]
        limit = min(_SCAN_TIMEOUT, self._timeout) if timeout is None else timeout
        limit = checks.number("timeout", limit, 0.0, 3600.0, above=True)
        return self._scan(wanted, limit)

    def _scan(self, units: Sequence[int], timeout: float) -> Iterator[Found]:
        for unit in units:
            started = self.now()
            code: int | None = None
            problem: str | None = None
            try:
                [code] = self._native.read(unit, _identification_address(), 1, timeout=timeout, retries=0)
            except NoAnswer:
                continue
            except (Refused, BadAnswer) as error:
                problem = str(error)
            family = None if code is None else identify(code)
            yield Found(unit, family, code, self.now() - started, problem)

    def drive(self, unit: int, profile: str | os.PathLike[str] | Profile | None = None) -> Drive:
        """The drive at *unit*.

        Args:
            unit: Its address, 1..247.
            profile: A shipped name, a folder, or a `Profile`. None asks the drive, by one read of its identification.

        Raises:
            NotAllowed: No such profile, or the drive names a family that no profile knows: give one.
            NoAnswer, BadAnswer, Refused: The drive did not tell; only if *profile* is None.
        """
        unit = checks.unit(unit)
        if profile is not None:
            return Drive(self, unit, Profile.find(profile))
        [code] = self.read(unit, _identification_address())
        return Drive(self, unit, self._profile_of(unit, code), code)

    def _profile_of(self, unit: int, code: int) -> Profile:
        family = identify(code)
        if family not in profiles():
            known = "no list names" if family is None else f"is a {family}, a family without a profile yet"
            raise NotAllowed(
                f"unit {unit} identifies itself as {code:04X}H, which {known}; the registers and command codes of "
                "another family may differ. If you know that it behaves like one of "
                f"{', '.join(profiles())}, give profile=…",
                unit=unit,
            )
        return Profile.builtin(family)

    def poll(
        self,
        targets: Mapping[Any, Any],
        interval: float | None = None,
        *,
        size: int = 10_000,
        callback: Callable[[Sample], object] | None = None,
    ) -> Poll:
        """Asks drives again and again, in a thread of the core's own, and gives what comes as samples.

            with bus.poll({drive: ["running_frequency", "output_current"], other: None}, interval=0.1) as poll:
                for sample in poll:
                    ...

        In each cycle every drive is asked once, in the fewest reads. Whatever else wants the line goes before the next
        request, a stop first. What is not answered is not repeated: the sample is marked `missing` and the next cycle
        asks again. A drive that is dead costs the others one time-out now and then, as always. A port that was lost is
        opened again. Several polls of a bus take turns.

        Args:
            targets: What to ask of whom: register names or parameter codes of a `Drive`, None for its monitor
                registers; of a unit that no profile is known of, by its address, `[(address, count), …]`.
            interval: Seconds from one cycle's beginning to the next one's. Beats do not drift; those that pass while
                the line is taken are counted (`Poll.late`) and not made up for. None: as fast as the wire.
            size: How many samples are kept for whoever takes them; then the oldest give way (`Poll.dropped`).
            callback: Is called for each sample, in a thread of its own. What it raises ends the poll and is raised by
                `Poll.wait` or at the end of the `with` block. In virtual time it is `Poll.wait` that calls it.

        Raises:
            NotAllowed: Nobody to poll, an unknown name, a drive of another bus, one unit twice, or an interval that is
                shorter than the wire can carry at this baud rate; the message has the shortest. Nothing was sent.
            PortError: The bus is closed.
        """
        return Poll(self, self._native, targets, interval, size, callback)

    def stats(self) -> Stats:
        """Counters and latencies since the bus was opened, for the line and (in `units`) for each unit.

        `hints` says in words what the figures most likely mean and what to do; it is empty for a sound line.
        """
        return Stats(self._native.stats())


def _identification_address() -> int:
    """Where a drive says what it is. All shipped families use one register."""
    return Profile.builtin(profiles()[0]).address(_IDENTIFICATION)
