"""One unit's registers and parameters by name, in engineering units.

Names become addresses, words become values, and back. What may be written, and where it is kept, is decided here;
what makes a motor turn is not: commands are refused, `Drive` has methods for them.

Written once, to be awaited: `drivebus.aio.Drive` is awaited, and `drivebus.Drive` carries the same out at once.
"""

from __future__ import annotations

import copy
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple, overload

from drivebus.errors import DrivebusError, NotAllowed, PortError, Refused, StoreWarning
from drivebus.identity import Identity
from drivebus.protocols import AwaitableBus, ProfileProtocol
from drivebus.values import Choice, Description, Snapshot, State, Value

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Registers"]

_STORES_BEFORE_WARNING = 5
"""EEPROM writes of one parameter by one program that are taken for use; more look like a loop."""


class _Planned(NamedTuple):
    name: str
    address: int
    raw: int


class Registers:
    """The registers and parameters of one unit.

    Attributes:
        bus: The line it hangs on.
        unit: Its address, 1..247.
        profile: What its words mean.

    *identification* is what it said when it was asked what it is; None if it was not.
    """

    def __init__(
        self, bus: AwaitableBus, unit: int, profile: ProfileProtocol, identification: int | None = None
    ) -> None:
        self.bus = bus
        self.unit = unit
        self.profile = profile
        self._identity = Identity(bus, unit, profile.identification_address, identification)
        self._seen: list[tuple[str, float]] = []
        self._in_ram: set[str] = set()
        self._stored: dict[str, int] = {}

    def over(self, bus: AwaitableBus) -> Self:
        """The same unit over another face of the same line; what is known of it is shared."""
        other = copy.copy(self)
        other.bus = bus
        return other

    def describe(self, name: str) -> Description:
        """All that is known of a register or parameter. Nothing is sent.

        Raises:
            NotAllowed: Unknown name; the message has the closest.
        """
        return self.profile.describe(name)

    @overload
    async def read(self, name: str, /, *, verify: bool = False) -> Value: ...
    @overload
    async def read(self, first: str, second: str, /, *more: str, verify: bool = False) -> dict[str, Value]: ...
    async def read(self, *names: str, verify: bool = False) -> Value | dict[str, Value]:
        """Reads registers or parameters in the fewest requests.

        One name gives its value, several give a dict in the order asked. Values are floats in engineering units, ints
        where the drive counts, and `Choice` where the profile has a name for what came.

        With *verify* each request is repeated until the same words came twice in a row: for values on which much
        depends, where even a damaged answer whose CRC is right by chance (one in 65 536) must not pass.

        Raises:
            NotAllowed: No name, or an unknown one; nothing was sent.
            NoAnswer, BadAnswer, Refused: See each. With *verify* also where the words change all the time.
        """
        if not names:
            raise NotAllowed("read() needs at least one name, such as 'output_current' or 'P00.11'")
        values = await self.snapshot(*names, verify=verify)
        return values[names[0]] if len(names) == 1 else dict(values)

    async def snapshot(self, *names: str, verify: bool = False) -> Snapshot:
        """Reads *names* in the fewest requests, under one time stamp. With *verify* as `read` does."""
        plan = self.profile.compile(names)
        answers: list[list[int]] = []
        started = ended = 0.0
        for address, count in plan.reads:
            with self._explained():
                words, sent, ended = await self.bus.read_stamped(self.unit, address, count, verify=verify)
            started = started if answers else sent
            answers.append(words)
        values = dict(zip(plan.names, plan.values(answers), strict=True))
        return Snapshot(values, plan.units, started, ended - started)

    async def read_words(
        self, address: int, count: int = 1, *, urgent: bool = False, verify: bool = False
    ) -> list[int]:
        """Reads words by address, as they are. As `Bus.read`, but a refusal says what this family means by it."""
        with self._explained():
            return await self.bus.read(self.unit, address, count, urgent=urgent, verify=verify)

    def value(self, name: str, raw: int) -> Value:
        """The word *raw* of *name* in engineering units."""
        value = self.profile.decode(name, raw)
        choices = self.profile.describe(name).choices
        if choices and isinstance(value, int) and value in choices:
            return Choice(value, choices[value])
        return value

    @overload
    async def write(self, name: str, value: object, store: bool = False) -> None: ...
    @overload
    async def write(self, name: Mapping[str, object], *, store: bool = False) -> None: ...
    async def write(self, name: str | Mapping[str, object], value: object = None, store: bool = False) -> None:
        """Writes one value, or several from a mapping, each by its own request.

        A confirmation that was lost is cleared up by reading the value. Only where the drive shows another one is the
        write repeated, as often as the bus repeats a read. What does something when it is written (P00.15 tunes the
        motor) tells nothing by being read: it is sent once.

        Parameters go to RAM: they are lost when the drive is switched off. With *store* they go to EEPROM, whose
        write life is limited; one that already has its value is not written again. A drive tells the value in force,
        not where it is kept: what this object wrote to RAM is stored, what somebody else did is taken for stored.

        All checks come first: if one value is not allowed, none is sent.

        Args:
            name: A register name or parameter code, or a mapping of them to values.
            value: In engineering units, or the label of a choice.
            store: Keep parameters in EEPROM.

        Raises:
            NotAllowed: Unknown name, out of range, read-only, a command, or writable only while stopped and the drive
                runs; or another drive answers at this address since the port was opened again. Nothing was sent.
            NoAnswer, BadAnswer, PortError: The drive may have taken the value all the same, unless the error's
                `started` is None: then it was not sent.
            Refused: The drive kept what it had.
            Unconfirmed: The drive shows another value, however often it was written.

        Where one of several fails, those before it were written; the error's note names them.
        """
        wanted = name if isinstance(name, Mapping) else {name: value}
        if not isinstance(name, Mapping) and value is None:
            raise NotAllowed(f"no value given for {name!r}; say write({name!r}, value)")
        planned = [self._plan_write(key, asked, store) for key, asked in wanted.items()]
        await self._check_state(planned)
        done: list[str] = []
        for item in planned:
            try:
                await self._write_one(item, store)
            except DrivebusError as error:
                if done and hasattr(error, "add_note"):
                    error.add_note(f"written before it: {', '.join(done)}")
                raise
            done.append(item.name)

    def _plan_write(self, name: str, value: object, store: bool) -> _Planned:
        known = self.profile.describe(name)
        if not known.writable:
            raise NotAllowed(f"{name} ({known.label}) is read-only; nothing was sent", unit=self.unit)
        if known.address is not None and self.profile.is_command(known.address):
            raise NotAllowed(
                f"{name} ({known.label}) can move the motor, so write() refuses it; use run(), stop(), coast(), jog() "
                "or reset_fault()",
                unit=self.unit,
            )
        return _Planned(name, self.profile.address(name, store=store), self.profile.encode(name, value))

    async def _check_state(self, planned: Sequence[_Planned]) -> None:
        only_stopped = [item.name for item in planned if self.profile.describe(item.name).access == "stop"]
        if not only_stopped:
            return
        state = await self.state()
        if state.running:
            raise NotAllowed(
                f"{', '.join(only_stopped)} can be written only while the drive is stopped, and unit {self.unit} runs "
                f"({state}); nothing was written",
                unit=self.unit,
            )

    async def _write_one(self, item: _Planned, store: bool) -> None:
        read_back = self.profile.read_back(item.name)
        is_parameter = self.profile.describe(item.name).kind == "parameter"
        if not is_parameter or not store:
            if is_parameter:
                # Before it is sent: the drive may take it although its answer is lost.
                self._in_ram.add(item.name)
            await self._write(item.address, item.raw, read_back=read_back)
            return
        # What is read is what is in force. It tells about EEPROM only if RAM was not written since.
        [in_force] = await self.read_words(self.profile.address(item.name))
        if in_force == item.raw and item.name not in self._in_ram:
            return
        # Where it is in force already, from RAM, reading it does not tell whether EEPROM took it.
        await self._write(item.address, item.raw, read_back=None if in_force == item.raw else read_back)
        self._in_ram.discard(item.name)
        self._count_store(item.name)

    def _count_store(self, name: str) -> None:
        self._stored[name] = times = self._stored.get(name, 0) + 1
        if times >= _STORES_BEFORE_WARNING:
            warnings.warn(
                f"{name} of unit {self.unit} was stored in EEPROM {times} times by this program; "
                "its write life is limited: write to RAM (store=False) in a loop",
                StoreWarning,
                stacklevel=_level_of_the_program(),
            )

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """A refusal inside says what this family means by its code, and what it was that was refused."""
        try:
            yield
        except Refused as error:
            name, meaning = self.profile.exception(error.code)
            raise Refused(
                f"unit {self.unit} refused {_asked(error.request)}: exception {error.code:02X}H, {name}: {meaning}",
                code=error.code,
                name=name,
                meaning=meaning,
                unit=error.unit,
                request=error.request,
                raw=error.raw,
                started=error.started,
                ended=error.ended,
            ) from None

    async def _write(self, address: int, value: int | Sequence[int], *, read_back: int | None = None) -> None:
        """Writes to the unit, if it still is the one it was."""
        connection = await self._identity.check(self.bus)
        try:
            await self._send(address, value, read_back=read_back, connection=connection)
        except PortError as error:
            if error.started is not None or self.bus.reconnects == connection:
                raise
            # A port that was lost is opened by what comes next. That was refused, to see first who answers there.
            await self._send(address, value, read_back=read_back, connection=await self._identity.check(self.bus))

    async def _send(
        self,
        address: int,
        value: int | Sequence[int],
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
    ) -> None:
        with self._explained():
            await self.bus.write(self.unit, address, value, urgent=urgent, read_back=read_back, connection=connection)

    async def state(self) -> State:
        """What the drive is doing: one read of its first status word."""
        [word] = await self.read_words(self.profile.address("status_word_1"))
        state = self._state_of(word)
        self._remember(str(state))
        return state

    def _state_of(self, word: int) -> State:
        try:
            return State(self.profile.state(word))
        except ValueError:
            return State.UNKNOWN

    def _remember(self, state: str) -> None:
        """Keeps the last state that was seen, for errors after which none can be read."""
        self._seen[:] = [(state, self.bus.now())]

    def _seen_last(self) -> str:
        """The last state that was seen, and how long ago on the line's clock."""
        if not self._seen:
            return "no state was ever seen"
        [(state, at)] = self._seen
        # A line that is lost may have no clock.
        age = max(self.bus.now() - at, 0.0)
        return f"state seen last, {age:.1f} s ago: {state}"


def _level_of_the_program() -> int:
    """Where the program stands above the caller, for `warnings.warn`: how deep depends on who carries the work out."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "drivebus":
        level, frame = level + 1, frame.f_back
    return level


def _asked(request: bytes) -> str:
    """What a request frame asked for, for people."""
    if len(request) < 6:
        return "the request"
    address = f"{int.from_bytes(request[2:4], 'big'):04X}H"
    number = int.from_bytes(request[4:6], "big")
    if request[1] == 0x03:
        return f"to read {number} word{'s' if number != 1 else ''} at {address}"
    return f"to write {number} at {address}" if request[1] == 0x06 else f"to write {number} words at {address}"
