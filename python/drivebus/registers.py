"""One unit's registers and parameters by name, in engineering units.

Names become addresses, and words become values. What may be read is decided here; what may be written is decided in
`parameters`.

Written once, to be awaited: `drivebus.aio.Drive` is awaited, and `drivebus.Drive` carries the same out at once.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, overload

from drivebus import checks
from drivebus.errors import NotAllowed, PortError, Refused
from drivebus.evidence import Evidence, not_verified
from drivebus.identify.same_unit import SameUnit
from drivebus.known import check_words
from drivebus.protocols import AwaitableBus, ProfileProtocol
from drivebus.values import Choice, Description, Snapshot, State, Value

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Registers"]

_LOCKED = ("password_error", "password_protected")
"""What INVT's families call the exceptions that have to do with the user password."""

_UNKNOWN, _NOWHERE = "unknown", "not_in_the_specification"
"""What an exception is called that no profile names, and one that the specification does not name either."""


class Registers:
    """The registers and parameters of one unit.

    Attributes:
        bus: The line it hangs on.
        unit: Its address, 1..247.
        profile: What its words mean.
        unverified: Whether what no document of its family proves is done all the same.

    *identification* is what it said when it was asked what it is; None if it was not. With *trust_profile*, what it
    says against its profile does not count.
    """

    unverified = False

    def __init__(
        self,
        bus: AwaitableBus,
        unit: int,
        profile: ProfileProtocol,
        identification: int | None = None,
        *,
        unverified: bool = False,
        trust_profile: bool = False,
    ) -> None:
        self.bus = bus
        self.unit = unit
        trusted = checks.flag("trust_profile", trust_profile)
        self._identity = SameUnit(bus, unit, profile, identification, trusted=trusted)
        self._seen: list[tuple[str, float]] = []
        self._in_ram: set[str] = set()
        self._stored: dict[str, int] = {}
        self._ventured: set[str] = set()
        # How it was started here last, if it was; unknown after a jog or a raw write. Views of the unit share the list.
        self._started_as: list[State] = []
        self._starts = [0]
        self._halts = [0]
        self._know(profile, checks.flag("unverified", unverified))

    def _know(self, profile: ProfileProtocol, unverified: bool) -> None:
        self.profile = profile
        self.unverified = unverified
        self._evidence = Evidence(profile, self.unit, unverified)
        self._variants = profile.variants()
        self._open_variants = set(self._variants) - set(profile.variants_chosen)

    def over(self, bus: AwaitableBus) -> Self:
        """The same unit over another face of the same line; what is known of it is shared."""
        other = copy.copy(self)
        other.bus = bus
        return other

    def trusting(self, unverified: bool) -> Self:
        """The same unit; if *unverified*, what is not verified is done all the same."""
        if not checks.flag("unverified", unverified) or self.unverified:
            return self
        return self._as(self.profile, True)

    def _as(self, profile: ProfileProtocol, unverified: bool) -> Self:
        other = copy.copy(self)
        other._know(profile, unverified)
        return other

    async def _settled(self, *names: str) -> Self:
        """The same unit, with everything fixed on which the meaning of *names* depends."""
        if not self._open_variants:
            return self
        wanted = [known.variant for name in names if (known := self.profile.describe(name)).variant]
        chosen = {variant: await self._variant(variant) for variant in wanted if variant in self._open_variants}
        if not chosen:
            return self
        return self._as(self.profile.with_variants({**self.profile.variants_chosen, **chosen}), self.unverified)

    async def _variant(self, variant: str) -> str:
        """What the drive's own parameter says of *variant*."""
        rule = self._variants[variant]
        parameter, choices = rule["parameter"], rule["choices"]
        which = ", ".join(map(repr, choices))
        given = f"variants={{{variant!r}: …}} for bus.drive() (`--variant {variant}=…`; {which}) says which"
        if rule["reason"] is not None and not self.unverified:
            raise not_verified(
                f"what {parameter} decides in {self.profile.title}, and so what the word means (its {variant})",
                f"{rule['reason'].rstrip('.')}; {given}",
                self.unit,
            )
        self._evidence.reads([parameter])
        [raw] = await self.read_words(self.profile.address(parameter))
        for choice, value in choices.items():
            if value == raw:
                return str(choice)
        raise NotAllowed(
            f"{parameter} of unit {self.unit} is {raw}, which means nothing known; {given}. Nothing was written",
            unit=self.unit,
        )

    async def contradiction(self) -> str | None:
        """What the unit says of itself that speaks against its profile, and what to do; None if nothing does.

        Reads, as the first write does. For a *trust_profile* too.

        Raises:
            NoAnswer, BadAnswer, PortError: It did not tell.
        """
        return await self._identity.contradiction(self.bus)

    def describe(self, name: str) -> Description:
        """All that is known of a register or parameter. Nothing is sent.

        Raises:
            NotAllowed: Unknown name; the message has the closest.
        """
        return self.profile.describe(name)

    @overload
    async def read(self, name: str, /, *, verify: bool = False, unverified: bool = False) -> Value: ...
    @overload
    async def read(
        self, first: str, second: str, /, *more: str, verify: bool = False, unverified: bool = False
    ) -> dict[str, Value]: ...
    async def read(self, *names: str, verify: bool = False, unverified: bool = False) -> Value | dict[str, Value]:
        """Reads registers or parameters in the fewest requests.

        One name gives its value, several give a dict in the order asked. Values are floats in engineering units, ints
        where the drive counts, and `Choice` where the profile has a name for what came.

        With *verify* each request is repeated until the same words came twice in a row: for values on which much
        depends, where even a damaged answer whose CRC is right by chance (one in 65 536) must not pass.

        With *unverified* also what no document of the family prints.

        Raises:
            NotAllowed: No name, an unknown one, or one that is not verified; nothing was sent.
            NoAnswer, BadAnswer, Refused: See each. With *verify* also where the words change all the time.
        """
        if not names:
            raise NotAllowed("read() needs at least one name, such as 'output_current' or 'P00.11'")
        values = await self.trusting(unverified).snapshot(*names, verify=verify)
        return values[names[0]] if len(names) == 1 else dict(values)

    async def snapshot(self, *names: str, verify: bool = False, unverified: bool = False) -> Snapshot:
        """Reads *names* in the fewest requests, under one time stamp. *verify* and *unverified* as for `read`."""
        drive = self.trusting(unverified)
        drive._evidence.reads(names)
        if drive._open_variants:
            drive = await drive._settled(*names)
        plan = drive.profile.compile(names)
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

    async def write_words(self, address: int, value: int | Sequence[int], force: bool = False) -> None:
        """Writes one word (an int: 06H) or several (a sequence: 10H) by address, as they are. Sent once.

        As `Bus.write`, but another drive that answers at this address gets nothing, and a refusal says what this family
        means by it. A word in the command register moves the motor.

        Args:
            address: 0..0xFFFF, with the bit for RAM or EEPROM where the family has one.
            value: Words of 0..0xFFFF.
            force: Also a command that the family does not define.

        Raises:
            NotAllowed: Out of range, or such a command; or another drive answers at this address since the port was
                opened again. Nothing was sent.
            NoAnswer, BadAnswer, PortError: The drive may have taken it, unless the error's `started` is None.
            Refused: The drive did not take it.
        """
        address, words = checks.address(address), checks.payload(value)
        if not checks.flag("force", force):
            check_words([self.profile], self.unit, address, words)
        if self.profile.is_command(address):
            self._started_as[:] = [State.UNKNOWN]
        await self._write(address, words, force=force)

    def value(self, name: str, raw: int) -> Value:
        """The word *raw* of *name* in engineering units."""
        value = self.profile.decode(name, raw)
        choices = self.profile.describe(name).choices
        if choices and isinstance(value, int) and value in choices:
            return Choice(value, choices[value])
        return value

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """A refusal inside says what this family means by its code, and what it was that was refused."""
        try:
            yield
        except Refused as error:
            name, meaning = self.profile.exception(error.code)
            if name == _UNKNOWN and error.name != _NOWHERE:
                name = error.name
                meaning = f"so in the Modbus specification; what a {self.profile.title} means by it is not known"
            raise Refused(
                f"unit {self.unit} refused {_asked(error.request)}: exception {error.code:02X}H, {name}: {meaning}"
                f"{self._about_password(name)}",
                code=error.code,
                name=name,
                meaning=meaning,
                unit=error.unit,
                request=error.request,
                raw=error.raw,
                started=error.started,
                ended=error.ended,
            ) from None

    def _about_password(self, exception: str) -> str:
        """What to do about a drive that is locked."""
        if exception not in _LOCKED:
            return ""
        described = (self.profile.describe(name) for name in self.profile.names())
        password = next((known for known in described if known.code and "password" in known.label.lower()), None)
        held = "The user password" if password is None else f"{password.code} holds the user password"
        return (
            f". {held}{' is set' if password is None else ', and it is set'}: type it in at the keypad, or take it off "
            "there, and ask again. How to unlock the drive over the bus is not printed"
        )

    async def _write(
        self,
        address: int,
        value: int | Sequence[int],
        *,
        read_back: int | None = None,
        force: bool = False,
        judged: bool = True,
    ) -> None:
        """Writes to the unit, if it still is the one it was and, where that is *judged*, does not say it is another."""
        connection = await self._identity.check(self.bus, judged=judged)
        try:
            await self._send(address, value, read_back=read_back, connection=connection, force=force)
        except PortError as error:
            if error.started is not None or self.bus.reconnects == connection:
                raise
            # A port that was lost is opened by what comes next. That was refused, to see first who answers there.
            connection = await self._identity.check(self.bus, judged=judged)
            await self._send(address, value, read_back=read_back, connection=connection, force=force)

    async def _send(
        self,
        address: int,
        value: int | Sequence[int],
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        force: bool = False,
    ) -> None:
        # What a bus of somebody's own must know is the rest: only a raw write is ever forced.
        forced = {"force": True} if force else {}
        with self._explained():
            await self.bus.write(
                self.unit, address, value, urgent=urgent, read_back=read_back, connection=connection, **forced
            )

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


def _asked(request: bytes) -> str:
    """What a request frame asked for, for people."""
    if len(request) < 6:
        return "the request"
    address = f"{int.from_bytes(request[2:4], 'big'):04X}H"
    number = int.from_bytes(request[4:6], "big")
    if request[1] == 0x03:
        return f"to read {number} word{'s' if number != 1 else ''} at {address}"
    return f"to write {number} at {address}" if request[1] == 0x06 else f"to write {number} words at {address}"
