"""A line with units on it: reads, writes, and everything else a master may ask.

The work is done in the compiled core, without the GIL. This module checks arguments, finds out who is there, and opens
what people type as a port.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar, overload

from drivebus import _native
from drivebus.checks import UNITS
from drivebus.drive import Drive
from drivebus.identify.profile_choice import profile_of
from drivebus.line.asking import asking
from drivebus.line.blocking import BlockingBus, at_once
from drivebus.line.blocking_requests import Requests
from drivebus.line.settings import BusFace, Opening, check_trust
from drivebus.line.units import belongs
from drivebus.operations.drive_base import views
from drivebus.operations.halting import WITHIN
from drivebus.operations.program_end import end_over
from drivebus.operations.stop_all import stop_all
from drivebus.profile import Profile, native_of
from drivebus.strict_attributes import known_only

if TYPE_CHECKING:
    from drivebus.identify.results import Found, Identification
    from drivebus.line.poll_samples import Names, Reads, Sample
    from drivebus.poll import Poll

__all__ = ["Bus"]

_AnyDrive = TypeVar("_AnyDrive", bound=Drive)


@known_only
class Bus(BusFace, Requests):
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
        read_only: Refuse every write before it is sent, a stop too, and in `transact` all bytes that do not have the
            form of a read: to a unit that speaks another protocol they may be a command.
        rs485: Direction control, for ports wired to a bare transceiver: `{"mode": "kernel"}` by the driver, `"rts"` by
            this program, `"auto"` by whichever can; with `rts_on_send`, `delay_before_ms`, `delay_after_ms`.
        echo: Whether the adapter hands back what it sends: `"auto"`, `"yes"` or `"no"`.
        turnaround: Seconds that units are given to act on a broadcast; nothing is sent meanwhile.
        learn_timeout: Give a unit that is read no longer than its answers have taught: four times the longest delay of
            its last 32 answers, at least 100 ms, beside the time the characters take; never longer than *timeout*. The
            next read after silence waits the whole *timeout* again. What `poll` asks waits so in any case.
        low_latency: Whether an adapter that keeps what it receives (FTDI: 16 ms) is told to hurry while it is open.
        queue: How many requests may wait for the line, 1..1000000. A full queue raises `NotAllowed` at once; a stop is
            always accepted.
        share: Whether other programs of the same user may use the port at the same time. `"auto"`: the first program to
            open the port owns it and serves later ones, which go through it. `"own"`: as the owner it serves nobody.
            `"never"`: it serves nobody, and a port that another program has is busy. For serial ports and `socket://`.
        group: A group of the system, by name or number, whose users may use the port through this program, beside its
            own user's: for a service. They meet in `/run/drivebus`, which this user has, or may make. They may do all
            that this program may. Unix only.
        realtime: Whether the threads of the bus's own go before all programs of the computer that did not ask for that:
            polls, event loops, clients over the network (`SCHED_FIFO`). What is asked from a thread of yours goes at
            its own priority. Where the system refuses it, `stats().notes` says so and what to do. Linux alone has it.
        reserved: Whether addresses that the specification reserves may be asked: units 248 to 254 on a serial line, and
            writes to unit 0 over `tcp://`, which a gateway hands on to every unit behind it. Without it, 0 can be read
            and 248 to 255 asked over `tcp://`.
        trace: A file that gets every frame of this bus, for Wireshark: pcapng, which it shows as Modbus RTU without a
            setting. An existing file is replaced.

    Raises:
        NotAllowed: An argument is wrong; nothing was opened.
        PortError: The port is not there, busy, or not permitted.

    Attributes:
        simulator: The simulator behind a `sim://` port or the one that was given; None on a real line.
        format: The `SerialFormat` in force.
    """

    def _begin(self, opening: Opening) -> None:
        self._opening = opening
        try:
            self._native = _native.Bus(opening.target, opening.format, **opening.keywords)
        except BaseException:
            opening.close()
            raise
        belongs(opening.known, self._native)
        opening.trace.begin(self._native)
        Requests.__init__(self, self._native, opening.known)

    def _core(self) -> _native.Bus:
        return self._native

    def close(self) -> None:
        """Closes the port, and ends a simulator that this bus made. Closing again does nothing.

        A motor that a block runs over it, in whatever thread, is stopped before. An open `serial.Serial` that was given
        stays open: it is its owner's.
        """
        end_over(self.line)
        self._native.close()
        self._opening.close()

    def stop_all(self, *, confirm: float = 1.0, within: float = WITHIN, unverified: bool = False) -> list[int]:
        """Stops every drive that `drive` was called for on this bus, and returns their addresses.

        First each gets its own family's stop, before all else that waits for the line; those that answered last time
        come first. Then each is sent it until it takes it, and proved as `Drive.stop` proves it, side by side. Nothing
        is broadcast: the code that stops one family means something else to another. What other programs on a shared
        port know is not known here.

        Args:
            confirm: Seconds until each must show it, 0..3600; 0 does not look.
            within: Seconds, 0..3600, for which each is sent its stop until it takes it.
            unverified: Also where the stop is not verified for the family, as where a drive was asked for so.

        Raises:
            NotStopped: One or more were not proved to stop; `failures` has the error of each. All others were.
            NotAllowed: No drive is known here; nothing was sent.
        """
        units = views(BlockingBus(self))
        return at_once(stop_all(units, confirm=confirm, within=within, unverified=unverified))

    def __enter__(self) -> Bus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def scan(
        self, units: Iterable[int] = UNITS, timeout: float | None = None, *, protocol: str = "auto"
    ) -> Iterator[Found]:
        """Asks each of *units* for its family, with the line's own settings, and yields those that answer at once.

        One read of the identification register each, not repeated, and a few more of those that answer and give no code
        that is known (see `identify`). A unit that refuses has answered too, and so has one whose answer is damaged:
        its `problem` says how (often two units with one address, or a wrong parity).

        Where nobody answered, the first 16 of *units* are asked once more, for a status in the protocol that older
        drives of Huanyang speak instead of Modbus: `Found.protocol`. A unit that speaks Modbus refuses that question.

        Args:
            units: Addresses, 1..247.
            timeout: Seconds each is given; None is 0.1 s, or the bus's own time-out if that is shorter.
            protocol: `"auto"`, as above; `"modbus"`: in that one alone; `"huanyang"`: each of *units* is asked in that
                one alone, and who speaks Modbus is not told.
        """
        from drivebus.identify import scan

        limit = scan.time_for(timeout, self._opening.timeout)
        return self._scan(scan.units(units, self._opening.known.addresses), limit, scan.protocol_of(protocol))

    def _scan(self, units: Sequence[int], timeout: float, protocol: str) -> Iterator[Found]:
        from drivebus.identify import scan
        from drivebus.line.scan_order import asked

        read = asking(BlockingBus(self), timeout=timeout, retries=0)

        async def ask(unit: int, pdu: bytes, reply_length: int) -> bytes:
            return self._native.transact(unit, pdu, reply_length, timeout=timeout, in_doubt=True)

        found: list[Found] = []
        is_first = protocol == "huanyang" and not self.stats()["requests"]
        for unit, foreign in asked(units, protocol, found):
            if foreign:
                one = at_once(scan.look_for_huanyang(ask, self.now, unit, is_first))
            else:
                one = at_once(scan.look_for(read, self.now, unit))
            is_first = False
            if one is not None:
                found.append(one)
                yield one

    def identify(self, unit: int) -> Identification:
        """Identifies the unit, and says how sure that is. Only reads.

        By its identification code; where it has none that is known, by which words it answers and which it refuses.

        Raises:
            NoAnswer, BadAnswer, PortError: It did not answer at all.
        """
        from drivebus.identify.identify import identify

        return at_once(identify(BlockingBus(self).ask, self._opening.known.addresses.unit(unit)))

    def drive(
        self,
        unit: int,
        profile: str | os.PathLike[str] | Profile | None = None,
        *,
        unverified: bool = False,
        variants: Mapping[str, str] | None = None,
        trust_profile: bool = False,
        urgent: bool = False,
    ) -> Drive:
        """The drive at *unit*.

        A *profile* is believed until something is to be written: first the drive is asked what it is, and where it says
        that it is another, nothing is written to it (`NotAllowed`). A stop, a coast and the end of a jog ask a few
        words where they might start a drive of another family, and halt what it shows.

        Args:
            unit: Its address, 1..247.
            profile: A shipped name, a folder, or a `Profile`. None asks the drive, by reads: see `identify`. It must be
                sure then: a code that documents print for one family with a profile.
            unverified: Whether what no document of its family proves is done all the same, in every call. Without a
                *profile* also: take it for what it may be, where there is one candidate only.
            variants: What a parameter of the drive decides, where it is known: `{"speed_unit": "Hz"}` of a VFD500.
            trust_profile: The *profile* is meant, whatever the drive says of itself. What halts it is chosen by what
                it shows all the same.
            urgent: Where the drive is asked what it is, ask before all who wait for the line, as for a stop.

        Raises:
            NotAllowed: No such profile or variant; or what the drive tells is not sure enough: give a profile.
            NoAnswer, BadAnswer: The drive did not tell; only if *profile* is None.
        """
        # Over a bus that is for reading only nothing is written to whoever it is.
        unit = self._opening.known.addresses.unit(unit, changes=not self.read_only)
        check_trust(profile, trust_profile)
        known, code = at_once(profile_of(BlockingBus(self), unit, profile, variants, unverified, urgent))
        drive = Drive(self, unit, known, code, unverified=unverified, trust_profile=trust_profile)
        self._opening.known.add(unit, known, unverified=unverified)
        self._native.set_profile(unit, native_of(known))
        return drive

    @overload
    def poll(
        self,
        targets: Mapping[_AnyDrive, Names],
        interval: float | None = None,
        *,
        size: int = 10_000,
        callback: Callable[[Sample[_AnyDrive]], object] | None = None,
    ) -> Poll[_AnyDrive]: ...
    @overload
    def poll(
        self,
        targets: Mapping[int, Reads],
        interval: float | None = None,
        *,
        size: int = 10_000,
        callback: Callable[[Sample[int]], object] | None = None,
    ) -> Poll[int]: ...
    @overload
    def poll(
        self,
        targets: Mapping[Drive | int, Names | Reads],
        interval: float | None = None,
        *,
        size: int = 10_000,
        callback: Callable[[Sample[Drive | int]], object] | None = None,
    ) -> Poll[Drive | int]: ...
    def poll(
        self,
        targets: Mapping[Any, Names | Reads],
        interval: float | None = None,
        *,
        size: int = 10_000,
        callback: Callable[[Sample[Any]], object] | None = None,
    ) -> Poll[Any]:
        """Polls drives in a thread of the core's own, and gives the values as samples.

            with bus.poll({drive: ["running_frequency", "output_current"], other: None}, interval=0.1) as poll:
                for sample in poll:
                    ...

        In each cycle every drive is asked once, in the fewest reads. Whatever else wants the line goes before the next
        request, a stop first. What is not answered is not repeated: the sample is marked `missing` and the next cycle
        asks again. A drive that is dead costs the others one time-out now and then, as always. A port that was lost is
        opened again. Several polls of a bus take turns.

        Args:
            targets: The drives, and what to read from each: register names or parameter codes, or None for the monitor
                registers. A unit without a profile is given by its address, with `[(address, count), …]`.
            interval: Seconds from the start of one cycle to the start of the next. Starts do not drift. Those that pass
                while the line is busy are counted (`Poll.late`) and not made up for. None: as fast as the wire.
            size: How many samples are kept for whoever takes them; then the oldest give way (`Poll.dropped`).
            callback: Is called for each sample, in a thread of its own. What it raises ends the poll and is raised by
                `Poll.wait` or at the end of the `with` block. In virtual time it is `Poll.wait` that calls it.

        Raises:
            NotAllowed: Nobody to poll, an unknown name, a drive of another bus, one unit twice, or an interval that is
                shorter than the wire can carry at this baud rate; the message has the shortest. Nothing was sent.
            PortError: The bus is closed.
        """
        from drivebus.poll import Poll

        return Poll(self, self._native, targets, interval, size, callback)
