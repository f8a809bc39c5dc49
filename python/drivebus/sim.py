"""A drive in the box: a simulated line with simulated drives, behind a pseudo-terminal, a TCP port, or in process.

    with drivebus.sim.Simulator({1: "gd350"}) as simulator, drivebus.Bus(simulator) as bus:
        bus.drive(1).status()

The line keeps real character times, in real time or in virtual time. `Simulator.line` spoils what it carries on demand;
`Simulator.drive` is the machine's side: its shaft, its load, its keypad.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from types import TracebackType
from typing import TypeVar

from drivebus import _native, checks
from drivebus._native import SerialFormat, SimulatedLine
from drivebus.advice import Advice, Text
from drivebus.errors import BadArgument, DrivebusWarning, NotAllowed, PortError, level_of_the_program
from drivebus.profile import Profile, native_of

__all__ = ["FAULT_KINDS", "SimulatedDrive", "SimulatedLine", "Simulator", "check_faults"]

FAULT_KINDS = _native.fault_kinds()
"""What can go wrong with an answer, by name: `"flip_bit"`, `"lose_byte"`, ..."""


SERVED = ("pty", "tcp", "process")
"""What a simulator is served by where nothing is said: the first that the system has."""

_IN_WORDS = {"pty": "pseudo-terminal", "tcp": "TCP port", "process": "simulation in this process"}
_SERVED_BY = {"pty": "by a pseudo-terminal", "tcp": "over TCP", "process": "in this process only"}

_ASKED = ("anything", "reads", "writes")
"""What a drive can be told to refuse."""

_LINE = "line"
"""What the link to a simulator's pseudo-terminal is called, in a folder of its own."""

_T = TypeVar("_T")

_UNPLUG = Advice("unplug", None, "; line.unplug() pulls out any port")


class SimulatedDrive:
    """One simulated drive, seen from its shaft and its keypad, not from the bus."""

    __slots__ = ("_native", "_profile")

    def __init__(self, native: _native.SimulatedDrive, profile: Profile) -> None:
        self._native = native
        self._profile = profile

    @property
    def unit(self) -> int:
        """Its address on the line, 1..247."""
        return self._native.unit

    @property
    def profile(self) -> str:
        """The family it behaves like."""
        return self._native.profile

    @property
    def state(self) -> str:
        """What it is doing, in the words of `drivebus.State`; a rectifier that feeds is "running"."""
        return self._native.state

    @property
    def frequency(self) -> float:
        """Output frequency in Hz, negative in reverse."""
        return self._native.frequency

    @property
    def speed(self) -> float:
        """Shaft speed in rpm, negative in reverse."""
        return self._native.speed

    @property
    def fault(self) -> int:
        """The present fault's number, 0 for none."""
        return self._native.fault

    @property
    def fault_name(self) -> str:
        """The letters on the keypad for the present fault, such as `"OL1"`; empty for none, or if not known."""
        return self._profile.fault(self.fault).mnemonic if self.fault else ""

    @property
    def load(self) -> float:
        """Load torque as a share of the motor's rated torque, 0.0..4.0. May be set."""
        return self._native.load

    @load.setter
    def load(self, share: float) -> None:
        self._native.load = checks.number("load", share, 0.0, 4.0)

    @property
    def inputs(self) -> int:
        """The digital inputs, bit 0 = S1. May be set."""
        return self._native.inputs

    @inputs.setter
    def inputs(self, bits: int) -> None:
        self._native.inputs = checks.whole("inputs", bits, 0, 0xFFFF, hexadecimal=True)

    def trip(self, fault: int | str) -> None:
        """Trips the drive with *fault*: its number, or its letters on the keypad, such as `"OL1"`."""
        self._native.trip(
            self._fault_code(fault) if isinstance(fault, str) else checks.whole("fault", fault, 1, 0xFFFF)
        )

    def _fault_code(self, mnemonic: str) -> int:
        fault = self._profile.fault_named(mnemonic)
        if fault is None:
            hint = checks.closest(mnemonic, [fault.mnemonic for fault in self._profile.faults() if fault.mnemonic])
            raise BadArgument(f"{self.profile} has no fault {checks.shown(mnemonic)}{hint}")
        return fault.code

    def refuse(
        self,
        code: int = 0x06,
        *,
        asked: str = "anything",
        share: float = 1.0,
        seconds: float | None = None,
        count: int | None = None,
        taken: bool = False,
    ) -> None:
        """Lets the drive refuse requests, from now on and instead of what it was told to refuse before.

        A request that is refused is not carried out, and counts as heard. Broadcasts are not refused.

        Args:
            code: The exception, 1..255.
            asked: Which requests: `"anything"`, `"reads"` (01H to 04H) or `"writes"` (all others).
            share: Only this share of them, 0.0..1.0, by chance from the simulation's seed.
            seconds: Only for so long.
            count: Only so many of them.
            taken: The drive does what it is asked, and answers by the exception all the same: 05H acknowledges. What it
                would refuse by itself it refuses so.

        Raises:
            NotAllowed: An argument is wrong; nothing was changed.
        """
        self._native.refuse(
            checks.whole("code", code, 1, 0xFF, hexadecimal=True),
            asked=checks.one_of("asked", asked, _ASKED),
            share=checks.number("share", share, 0.0, 1.0),
            seconds=None if seconds is None else checks.number("seconds", seconds, 0.0),
            count=None if count is None else checks.whole("count", count, 0, 2**64 - 1),
            taken=checks.flag("taken", taken),
        )

    def limit(self, address: int, highest: int) -> None:
        """Lets the drive take no more than *highest* where more is written to *address* by 06H; its answer says so.

        The address is that of the request, with the bit for the other memory if it has one.
        """
        self._native.limit(checks.address(address), checks.whole("highest", highest, 0, 0xFFFF, hexadecimal=True))

    def refuse_no_more(self) -> None:
        """Lets the drive refuse only what its family refuses."""
        self._native.refuse_no_more()

    def power_cycle(self) -> None:
        """Switches the drive off and on: RAM is lost, EEPROM stays."""
        self._native.power_cycle()

    def factory_reset(self) -> None:
        """Gives every parameter its factory value, as the keypad does. It does not count as a write from the bus.

        The address on the line and the history of faults stay. NotAllowed while the motor is fed.
        """
        self._native.factory_reset()

    def register(self, address: int) -> int:
        """The word at *address* as the drive would answer it now. NotAllowed where it would refuse."""
        return self._native.register(checks.address(address))

    @property
    def eeprom_writes(self) -> int:
        """How many words the bus has written to EEPROM since the simulation began."""
        return self._native.eeprom_writes

    def eeprom_writes_of(self, address: int) -> int:
        """How many words the bus has written to EEPROM for the parameter at *address*.

        The address may have the bit for the other memory or not.
        """
        return self._native.eeprom_writes_of(checks.address(address))

    def writes(self) -> list[tuple[float, int, int]]:
        """The last 100 000 words the drive took from the bus: seconds since the simulation began, address, value."""
        return self._native.writes()

    def take_writes(self) -> list[tuple[float, int, int]]:
        """Returns what `writes` does and empties the list: who takes them often enough misses none."""
        return self._native.take_writes()

    @property
    def words_written(self) -> int:
        """How many words the drive has taken from the bus, ever."""
        return self._native.words_written

    def __repr__(self) -> str:
        return f"<SimulatedDrive {self.unit}: {self.profile}, {self.state}, {self.frequency:.2f} Hz>"


class Simulator:
    """A simulated line with simulated drives on it.

    Args:
        units: The family on each unit address, such as `{1: "gd350", 2: "vfd500"}`: any that has a profile, the folder
            of a profile of your own (`"./acme"`, or a path), or a `drivebus.Profile`.
        baudrate: Bits per second on the line.
        parity: `"N"`, `"E"` or `"O"`.
        stopbits: 1 or 2.
        bytesize: 7 or 8.
        silence: `"spec"`, `"characters"` or seconds, as for `drivebus.SerialFormat`.
        seed: Makes every random choice repeatable.
        transport: `"pty"` (a pseudo-terminal, for any program), `"tcp"` (RTU over TCP on 127.0.0.1), `"process"`
            (only for `drivebus.Bus(simulator)`), or `"auto"`: the first of them that the system has, with a
            `DrivebusWarning` where that is not the first.
        clock: `"real"`, or `"virtual"` (only with `"process"`): time jumps to what happens next, nobody waits.
        strict_silence: Whether drives ignore requests that come before the silence is over, as real ones do.
        faults: The share (0.0..1.0) of answers that each kind of fault hits, such as `{"flip_bit": 0.02}`;
            `"all"` is every kind but `"unplug"`. docs/reference/simulator.md says what each does.
        echo: Whether the adapter hands back what it sends.
        link: A symbolic link that is kept leading to the pseudo-terminal, whatever name `line.replug()` gave it. With
            it `"auto"` means `"pty"`.
        fifo: After how many characters of an answer a pseudo-terminal or TCP port hands them over, 1..256, as the FIFO
            of a UART does; the end of an answer comes at once. 1: each character at its moment.
        ear: True opens a second pseudo-terminal, at which another program overhears all that goes over the line, of
            masters and of units, and can say nothing: for `drivebus.sniff` beside a master that is not drivebus. A path
            is a symbolic link that leads there. Needs real time.

    Raises:
        NotAllowed: An argument is wrong, or a profile lacks what a simulation needs: the message says what, and where.
        PortError: The pseudo-terminal or TCP port could not be opened.

    Attributes:
        format: The `SerialFormat` of the line.
        transport: As above: what it is served by.
        seed: As above: the same seed, arguments and requests give the same run in virtual time.
    """

    __slots__ = ("__weakref__", "_folder", "_link", "_native", "_profiles", "format", "seed", "transport")

    def __init__(
        self,
        units: Mapping[int, str | os.PathLike[str] | Profile],
        *,
        baudrate: int = 19200,
        parity: str = "E",
        stopbits: int = 1,
        bytesize: int = 8,
        silence: str | float = "spec",
        seed: int = 0,
        transport: str = "auto",
        clock: str = "real",
        strict_silence: bool = False,
        faults: Mapping[str, float] | None = None,
        echo: bool = False,
        link: str | os.PathLike[str] | None = None,
        fifo: int = 8,
        ear: bool | str | os.PathLike[str] = False,
    ) -> None:
        checks.one_of("transport", transport, ("auto", "pty", "tcp", "process"))
        checks.one_of("clock", clock, ("real", "virtual"))
        if clock == "virtual" and transport != "process":
            raise BadArgument(
                f'clock "virtual" needs transport "process": nothing outside can share it over "{transport}"'
            )
        if link is not None:
            link = checks.path("link", link)
            if transport not in ("auto", "pty"):
                raise BadArgument(f'link {checks.shown(link)} leads to a pseudo-terminal: it needs transport "pty"')
        ear_link = None if isinstance(ear, bool) else checks.path("ear", ear)
        if clock == "virtual" and ear is not False:
            raise BadArgument('an ear is for another program, which lives in real time: it needs clock "real"')
        self._profiles = _profiles_of(units)
        families = {unit: native_of(profile) for unit, profile in self._profiles.items()}
        checks.flag("strict_silence", strict_silence)
        checks.flag("echo", echo)
        rates = check_faults({} if faults is None else faults, transport)
        self.format = SerialFormat(baudrate, parity, stopbits, bytesize, silence)
        self.seed = checks.whole("seed", seed, 0, 2**64 - 1)
        fifo = checks.whole("fifo", fifo, 1, 256)
        # A bus that is made from this finds it again when its pseudo-terminal has another number.
        self._folder = _folder(self) if link is None and transport in ("auto", "pty") else None
        lasting = link if self._folder is None else f"{self._folder}/{_LINE}"

        def served(by: str) -> _native.Simulator:
            return _native.Simulator(
                families,
                self.format,
                seed=self.seed,
                transport=by,
                realtime=clock == "real",
                strict_silence=strict_silence,
                link=lasting if by == "pty" else None,
                fifo=fifo,
                ear=ear is True,
                ear_link=ear_link,
            )

        anything = SERVED if link is None else ("pty",)
        self.transport, self._native = first_served(anything if transport == "auto" else (transport,), served)
        self._link = lasting if self.transport == "pty" else None
        self.line.set_faults(**rates)
        self.line.echo = echo

    @property
    def port(self) -> str:
        """The port that another program opens: a path or `socket://127.0.0.1:N`; `sim:…` in process."""
        return self._native.port

    @property
    def ear(self) -> str | None:
        """The pseudo-terminal at which another program overhears the line; None where none was asked for."""
        return self._native.ear

    @property
    def line(self) -> SimulatedLine:
        """The simulated wire: what was on it, and how it spoils answers."""
        return self._native.line

    def drive(self, unit: int) -> SimulatedDrive:
        """The simulated drive at *unit*, seen from its shaft and keypad."""
        native = self._native.drive(checks.unit(unit))
        return SimulatedDrive(native, self._profiles[native.unit])

    @property
    def units(self) -> list[int]:
        """The addresses of its drives, the lowest first."""
        return sorted(self._profiles)

    def now(self) -> float:
        """Seconds since the simulation began."""
        return self._native.now()

    def advance(self, seconds: float) -> None:
        """Lets virtual time pass. NotAllowed on a real-time simulation."""
        self._native.advance(checks.number("seconds", seconds, 0.0))

    def close(self) -> None:
        """Ends the simulation. Closing again does nothing."""
        self._native.close()
        if self._folder is not None:
            _remove(self._folder, os.getpid())

    def __enter__(self) -> Simulator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Simulator on {self.port}>"


def first_served(transports: Sequence[str], served: Callable[[str], _T]) -> tuple[str, _T]:
    """The first of *transports* that the system has, and what *served* made by it; says so where it is not the first.

    Raises:
        PortError, NotAllowed: The system has none of them; as the last one said.
    """
    missing: list[str] = []
    for transport in transports:
        try:
            made = served(transport)
        except (PortError, NotAllowed) as error:
            if transport == transports[-1]:
                raise
            missing.append(f"no {_IN_WORDS[transport]} ({error})")
        else:
            if missing:
                text = f"{', '.join(missing)}: the simulator is served {_SERVED_BY[transport]}"
                warnings.warn(text, DrivebusWarning, stacklevel=level_of_the_program())
            return transport, made
    raise BadArgument("no transport was given")


def core_of(simulator: Simulator) -> _native.Simulator:
    """What serves the line, in the core."""
    return simulator._native


def lasting_port(simulator: Simulator) -> str:
    """What to open, now and after each `line.replug()`: its port, or a link that is kept leading there."""
    return simulator.port if simulator._link is None else simulator._link


def _folder(simulator: Simulator) -> str | None:
    """A folder for the link of *simulator*, which goes with it; None where there can be none."""
    # Imported here: not every program makes a simulator.
    import tempfile
    import weakref

    try:
        folder = tempfile.mkdtemp(prefix="drivebus-sim-")
    except OSError:
        return None
    weakref.finalize(simulator, _remove, folder, os.getpid())
    return folder


def _remove(folder: str, made_by: int) -> None:
    """Removes *folder*, unless a forked child of the process that made it does."""
    if os.getpid() == made_by:
        with suppress(OSError):
            os.unlink(f"{folder}/{_LINE}")  # noqa: PTH108 - pathlib would be loaded for every stop
        with suppress(OSError):
            os.rmdir(folder)  # noqa: PTH106


def check_faults(faults: Mapping[str, float], transport: str) -> dict[str, float]:
    """*faults* as rates, if each is a kind of fault (or "all") with a share that this transport can have."""
    if not isinstance(faults, Mapping):
        raise BadArgument(
            f'faults {checks.shown(faults)} is not a mapping; give one such as {{"flip_bit": 0.02}}, or None'
        )
    rates = {}
    for kind, rate in faults.items():
        checks.one_of("fault", kind, ("all", *FAULT_KINDS))
        rates[kind] = checks.number(f"rate of {kind}", rate, 0.0, 1.0)
    if rates.get("unplug") and transport != "process":
        raise BadArgument(Text('"unplug" by rate needs transport "process"', _UNPLUG))
    return rates


def _profiles_of(units: object) -> dict[int, Profile]:
    """The profile of each of *units*, if that is what they are."""
    if not isinstance(units, Mapping) or not units:
        raise BadArgument(f'units {checks.shown(units)} name no drive; give at least one, such as {{1: "gd350"}}')
    return {checks.unit(unit): Profile.find(profile) for unit, profile in units.items()}
