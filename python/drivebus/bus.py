"""A line with units on it: reads, writes, and everything else a master may ask.

The work is done in the compiled core, without the GIL. This module checks arguments, finds out who is there, and opens
what people type as a port.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import Any

from drivebus import _native, checks
from drivebus._native import SerialFormat
from drivebus.at_once import BlockingBus, at_once
from drivebus.drive import Drive
from drivebus.errors import NotAllowed
from drivebus.figures import Link
from drivebus.identify import scan
from drivebus.identify.choose import profile_of
from drivebus.identify.identify import identify
from drivebus.identify.results import Found, Identification
from drivebus.opening import BusFace, Opening, check_order, check_trust
from drivebus.poll import Poll
from drivebus.polling import Sample
from drivebus.profile import Profile
from drivebus.safeguard import end_over

__all__ = ["Bus"]


class Bus(BusFace[_native.Bus]):
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
            its last 32 answers, at least 100 ms, beside the time the characters take; never longer than *timeout*. The
            next read after silence waits the whole *timeout* again. What `poll` asks waits so in any case.
        low_latency: Whether an adapter that keeps what it receives (FTDI: 16 ms) is told to hurry while it is open.
        queue: How many requests may wait for the line, 1..1000000. Who finds no room is told so at once (`NotAllowed`);
            a stop always does.

    Raises:
        NotAllowed: An argument is wrong; nothing was opened.
        PortError: The port is not there, busy, or not permitted.

    Attributes:
        simulator: The simulator behind a `sim://` port or the one that was given; None on a real line.
        format: The `SerialFormat` in force.
    """

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
        )
        super().__init__(opening, _native.Bus(opening.target, opening.format, **opening.keywords))

    @classmethod
    def around(cls, opening: Opening, native: _native.Bus) -> Bus:
        """Another face of a bus that is open."""
        self = cls.__new__(cls)
        BusFace.__init__(self, opening, native)
        return self

    def close(self) -> None:
        """Closes the port, and ends a simulator that this bus made. Closing again does nothing.

        A motor that a block runs over it, in whatever thread, is stopped before. An open `serial.Serial` that was given
        stays open: it is its owner's.
        """
        end_over(self.line)
        self._native.close()
        if self._owned is not None:
            self._owned.close()

    @property
    def line(self) -> object:
        """What stands for the line: the same for each face of it."""
        return self._native

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def sleep(self, seconds: float, /) -> None:
        """Waits on the line's clock. Ctrl-C ends it at once."""
        return self._native.sleep(checks.number("seconds", seconds, 0.0))

    def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """What comes within *seconds* while nothing is asked: pieces, each with its moment on the line's clock.

        On a sound line of one's own that is nothing. Requests of other threads go before, within 50 ms; their answers
        are theirs.
        """
        return self._native.listen(checks.number("seconds", seconds, 0.0))

    def read(self, unit: int, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False) -> list[int]:
        """Reads *count* words (1..125) of *unit* (1..247) from *address* (0..0xFFFF): function 03H.

        Drives allow fewer words than the protocol (INVT: 16) and refuse more themselves.

        While a late answer to an earlier request could pass for the one to this read, a few words more may be asked
        for, 16 at most, and cut off again. A call sends 8 requests at most for each time that it may ask (1 + *retries*
        of the bus), whatever they are for.

        An *urgent* read overtakes all who wait: for confirming a stop. With *verify* it is asked until the same words
        came twice in a row: against noise that happens to match its CRC, as one damaged answer in 65 536 does.

        Raises:
            NoAnswer, BadAnswer: After the bus's retries; with *verify*, also where the words change all the time.
            PortError: The port is lost, or the bus closed.
            Refused: The unit says no. What its code means in this family, only a `Drive` knows.
        """
        unit, address, count = checks.unit(unit), checks.address(address), checks.whole("count", count, 1, 125)
        check_order(urgent, verify)
        return self._native.read(unit, address, count, urgent=urgent, verify=verify)

    def read_stamped(
        self, unit: int, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False
    ) -> tuple[list[int], float, float]:
        """As `read`, with the Unix times at which the request left and at which the answer was complete."""
        unit, address, count = checks.unit(unit), checks.address(address), checks.whole("count", count, 1, 125)
        check_order(urgent, verify)
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
        force: bool = False,
    ) -> None:
        """Writes one word (an int: 06H) or 1..123 words (a sequence: 10H) of 0..0xFFFF. Sent once, never repeated.

        A word in a command register moves the motor. Of units for which `drive` was asked, the family is known: a word
        that would be a command which that family does not define, or the command register of another one, is refused
        unless *force*. Of other units nothing is known here.

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
            NotAllowed: An argument is out of range, the bus is read-only, or it would be such a command. Nothing was
                sent.
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
        check_order(urgent)
        self._known.check(unit, address, words, checks.flag("force", force))
        return self._native.write(unit, address, words, urgent=urgent, read_back=read_back, connection=connection)

    def link(self, unit: int) -> Link:
        """How well *unit* could be reached: of its last exchanges, ten at most, how many brought an answer."""
        return Link(*self._native.link(checks.unit(unit)))

    def broadcast(self, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
        """Writes to every unit at once; none answers. Returns after the turnaround delay. Sent once.

        Refused as `write` refuses it if one of the units whose family is known would take it for something else.
        """
        address, words = checks.address(address), checks.payload(value)
        self._known.check(0, address, words, checks.flag("force", force))
        return self._native.broadcast(address, words)

    def echo(self, unit: int, word: int | None = None) -> float:
        """Asks *unit* to send *word* (0..0xFFFF, random if None) back: 08H/0000. Returns the round trip in seconds."""
        if word is not None:
            word = checks.whole("word", word, 0, 0xFFFF, hexadecimal=True)
        return self._native.echo(checks.unit(unit), word)

    def transact(
        self,
        unit: int,
        pdu: bytes | bytearray | memoryview,
        reply_length: int | None = None,
        *,
        force: bool = False,
    ) -> bytes:
        """Sends any PDU (1..253 bytes) and returns the answer's PDU; unit and CRC are added and checked. Sent once.

        *reply_length* is the length of the answer's PDU in bytes; without it, the end is found by function or silence,
        and what the specification says of that function's answers is checked.
        What 06H and 10H would write is refused as `write` refuses it, unless *force*.
        """
        try:
            body = bytes(memoryview(pdu))
        except TypeError:
            raise NotAllowed(f"PDU {pdu!r} is not bytes; give 1..253 bytes, function code first") from None
        if not 1 <= len(body) <= 253:
            raise NotAllowed(f"a PDU of {len(body)} bytes is not allowed; give 1..253 bytes, function code first")
        if reply_length is not None:
            reply_length = checks.whole("reply_length", reply_length, 1, 253)
        unit = checks.unit(unit)
        self._known.check_pdu(unit, body, checks.flag("force", force))
        return self._native.transact(unit, body, reply_length)

    def scan(self, units: Iterable[int] = range(1, 248), timeout: float | None = None) -> Iterator[Found]:
        """Asks each of *units* who it is, and yields those that answer as they do.

        One read of the identification register each, not repeated, and a few more of those that answer and give no code
        that is known (see `identify`). A unit that refuses has answered too, and so has one whose answer is damaged:
        its `problem` says how (often two units with one address, or a wrong parity).

        Args:
            units: Addresses, 1..247.
            timeout: Seconds each is given; None is 0.1 s, or the bus's own time-out if that is shorter.
        """
        return self._scan(scan.units(units), scan.time_for(timeout, self._timeout))

    def _scan(self, units: Sequence[int], timeout: float) -> Iterator[Found]:
        async def read(unit: int, address: int) -> list[int]:
            return self._native.read(unit, address, 1, timeout=timeout, retries=0)

        for unit in units:
            found = at_once(scan.look_for(read, self.now, unit))
            if found is not None:
                yield found

    def identify(self, unit: int) -> Identification:
        """What the unit is, as far as it tells, and how sure that is. Only reads.

        By its identification code; where it has none that is known, by which words it answers and which it refuses.

        Raises:
            NoAnswer, BadAnswer, PortError: It did not answer at all.
        """
        return at_once(identify(BlockingBus(self).read, checks.unit(unit)))

    def drive(
        self,
        unit: int,
        profile: str | os.PathLike[str] | Profile | None = None,
        *,
        unverified: bool = False,
        variants: Mapping[str, str] | None = None,
        trust_profile: bool = False,
    ) -> Drive:
        """The drive at *unit*.

        A *profile* is believed until something is to be written: first the drive is asked what it is, and where it says
        that it is another, nothing is written to it (`NotAllowed`). A stop, a coast and the end of a jog ask nothing.

        Args:
            unit: Its address, 1..247.
            profile: A shipped name, a folder, or a `Profile`. None asks the drive, by reads: see `identify`. It must be
                sure then: a code that documents print for one family with a profile.
            unverified: Whether what no document of its family proves is done all the same, in every call. Without a
                *profile* also: take it for what it may be, where there is one candidate only.
            variants: What a parameter of the drive decides, where it is known: `{"speed_unit": "Hz"}` of a VFD500.
            trust_profile: The *profile* is meant, whatever the drive says of itself.

        Raises:
            NotAllowed: No such profile or variant; or what the drive tells is not sure enough: give a profile.
            NoAnswer, BadAnswer: The drive did not tell; only if *profile* is None.
        """
        unit = checks.unit(unit)
        check_trust(profile, trust_profile)
        known, code = at_once(profile_of(BlockingBus(self), unit, profile, variants, unverified))
        drive = Drive(self, unit, known, code, unverified=unverified, trust_profile=trust_profile)
        self._known.add(unit, known)
        return drive

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
