"""What a bus may be asked: each request is checked, and then sent by the core, which blocks until there is an answer.

The functions check what is given, before anything is sent; `drivebus.aio.requests` awaits what they let pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from drivebus import _native, checks, tables
from drivebus.errors import BadArgument, Refused
from drivebus.line.units import Units

if TYPE_CHECKING:
    from drivebus.line.device import DeviceIdentification
    from drivebus.line.stats import Link

__all__ = ["Requests", "alone_of", "broadcast_of", "echo_of", "read_of", "seconds_of", "transact_of", "write_of"]


class Requests:
    """A bus of the core, and what is known of the units on it.

    Args:
        native: The bus of the core.
        known: The families of its units, as far as drives were asked for.
    """

    def __init__(self, native: _native.Bus, known: Units) -> None:
        self._native = native
        self._known = known

    def now(self) -> float:
        """Seconds on the line's clock: real time, or the simulation's."""
        return self._native.now()

    @property
    def reconnects(self) -> int:
        """How often the port was opened again after it was lost. Another drive may answer behind it."""
        return self._native.reconnects

    @property
    def closed(self) -> bool:
        """Whether `close` was called; in a forked child True, for the line is its parent's."""
        return self._native.closed

    @property
    def line(self) -> object:
        """What stands for the line: the same for each face of it."""
        return self._native

    def sleep(self, seconds: float, /) -> None:
        """Waits on the line's clock. Ctrl-C ends it at once."""
        return self._native.sleep(seconds_of(seconds))

    def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """What comes within *seconds* while nothing is asked: pieces, each with its moment on the line's clock.

        On a sound line of one's own that is nothing. Requests of other threads go before, within 50 ms; their answers
        are theirs.
        """
        return self._native.listen(seconds_of(seconds))

    def read(
        self,
        unit: int,
        address: int,
        count: int = 1,
        *,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
        timeout: float | None = None,
        retries: int | None = None,
    ) -> list[int]:
        """Reads *count* words (1..125) of *unit* (1..247) from *address* (0..0xFFFF): function 03H.

        With *table*, `"input"` registers (04H), or bits, 1..2000 of them and each 0 or 1: `"coil"` (01H), `"discrete"`
        (02H).

        Drives allow fewer words than the protocol (INVT: 16) and refuse more themselves.

        While a late answer to an earlier request could pass for the one to this read, a few words more may be asked
        for, 16 at most, and cut off again. Where that does not help, two reads of fewer words are asked that have one
        in common: two neighbours always come from one answer, three words and more may be of two moments. *verify* asks
        for all of them at once. A call sends 8 requests at most for each time that it may ask (1 + *retries* of the
        bus), whatever they are for, and 3 more for each time that an answer has to come again.

        *timeout* (seconds) and *retries* are for this read alone; None is what the bus has.

        An *urgent* read overtakes all who wait: for confirming a stop. With *verify* it is asked until the same words
        came twice in a row: against noise that happens to match its CRC, as one damaged answer in 65 536 does.

        Raises:
            NoAnswer, BadAnswer: After the bus's retries; with *verify*, also where the words change all the time.
            PortError: The port is lost, or the bus closed.
            Refused: The unit says no. What its code means in this family, only a `Drive` knows.
        """
        checked = read_of(self._known, unit, address, count, table, urgent, verify)
        alone = alone_of(timeout, retries)
        return self._native.read(*checked, urgent=urgent, verify=verify, table=table, **alone)

    def read_stamped(
        self,
        unit: int,
        address: int,
        count: int = 1,
        *,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
    ) -> tuple[list[int], float, float]:
        """As `read`, with the Unix times at which the request left and at which the answer was complete."""
        checked = read_of(self._known, unit, address, count, table, urgent, verify)
        return self._native.read_stamped(*checked, urgent=urgent, verify=verify, table=table)

    def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        *,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        halts: int | None = None,
        force: bool = False,
        table: str = "holding",
        timeout: float | None = None,
    ) -> None:
        """Writes one word (an int: 06H) or 1..123 words (a sequence: 10H) of 0..0xFFFF. Sent once, never repeated.

        With *table* `"coil"` one coil, to 0 or 1 (05H).

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

        With *halts*, what `halts` of the unit was when you decided on this, nothing is sent where a stop was since:
        `NotReady`, whose `why` is `"halted"`. An urgent write goes out in any case.

        *timeout*, in seconds, is how long this write waits for its confirmation; None is what the bus has.

        Raises:
            NotAllowed: An argument is out of range, the bus is read-only, or it would be such a command. Nothing was
                sent.
            NoAnswer, BadAnswer, PortError: The unit may have taken it all the same, unless the error's `started` is
                None: then it was not sent.
            Refused: The unit did not take it.
            Unconfirmed: With *read_back*: the unit shows other words, however often it was written.
        """
        checked = write_of(self._known, unit, address, value, table, urgent, read_back, connection, halts, force)
        self._native.write(
            *checked,
            urgent=urgent,
            read_back=read_back,
            connection=connection,
            halts=halts,
            table=table,
            **alone_of(timeout),
        )

    def link(self, unit: int) -> Link:
        """How well *unit* could be reached: of its last exchanges, ten at most, how many brought an answer."""
        from drivebus.line.stats import Link

        return Link(*self._native.link(self._known.addresses.unit(unit)))

    def halts(self, unit: int) -> int:
        """A number that is another one each time *unit* is told to stop over this line, by this program or another.

        What counts is an urgent write, as `Drive.stop` and `coast` send it, from when it begins to wait for the line.
        Where another program has the port, it is asked, a second at most.
        """
        return self._native.halts(self._known.addresses.unit(unit))

    def broadcast(self, address: int, value: int | Sequence[int], *, force: bool = False) -> None:
        """Writes to every unit at once; none answers. Returns after the turnaround delay. Sent once.

        Refused as `write` refuses it if one of the units whose family is known would take it for something else.
        """
        self._native.broadcast(*broadcast_of(self._known, address, value, force))

    def echo(self, unit: int, word: int | None = None) -> float:
        """Asks *unit* to send *word* (0..0xFFFF, random if None) back: 08H/0000. Returns the round trip in seconds."""
        return self._native.echo(*echo_of(self._known, unit, word))

    def device_identification(self, unit: int) -> DeviceIdentification:
        """Who made *unit* and what it is, as it says itself (2BH/0EH). Nothing of it changes.

        What does not fit into one answer is asked for by more requests, 32 at most.

        Raises:
            Refused: Most units do not know the function, and refuse it with 01H.
            NoAnswer, BadAnswer, PortError: The unit did not tell.
        """
        from drivebus.line.device import device_of

        unit, question = self._known.addresses.unit(unit), _native.DeviceQuestion()
        while (pdu := question.pdu()) is not None:
            try:
                question.heard(self._native.transact(unit, pdu, retries=None))
            except Refused as refusal:
                if not question.refused(refusal.code):
                    raise
        return device_of(unit, question)

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
        What 06H, 0FH, 10H, 16H and 17H would write is refused as `write` refuses it, unless *force*.
        """
        return self._native.transact(*transact_of(self._known, unit, pdu, reply_length, force))


def read_of(
    known: Units, unit: int, address: int, count: int, table: object, urgent: object, verify: object
) -> tuple[int, int, int]:
    """What a read is of: unit, address and count. Raises `NotAllowed` where something is out of range."""
    most = 125 if table == "holding" or checks.one_of("table", table, tables.TABLES) not in tables.BITS else 2000
    unit, address = known.addresses.unit(unit), checks.address(address)
    count = checks.whole("count", count, 1, most)
    # Without a call for each of them where both are right.
    if type(urgent) is not bool or type(verify) is not bool:
        checks.flag("urgent", urgent)
        checks.flag("verify", verify)
    return unit, address, count


def alone_of(timeout: float | None, retries: int | None = None) -> dict[str, Any]:
    """What one call wants otherwise than its bus. Raises `NotAllowed` where that is out of range."""
    alone: dict[str, Any] = {}
    if timeout is not None:
        alone["timeout"] = checks.number("timeout", timeout, 0.0, 3600.0, above=True)
    if retries is not None:
        alone["retries"] = checks.whole("retries", retries, 0, 100)
    return alone


def write_of(
    known: Units,
    unit: int,
    address: int,
    value: int | Sequence[int],
    table: object,
    urgent: object,
    read_back: int | None,
    connection: int | None,
    halts: int | None,
    force: object,
) -> tuple[int, int, int | list[int]]:
    """What a write is of: unit, address and words.

    Raises `NotAllowed` where something is out of range, or would be an unknown command.
    """
    if read_back is not None:
        checks.whole("read_back", read_back, 0, 0xFFFF, hexadecimal=True)
    if connection is not None:
        checks.whole("connection", connection, 0, 2**63)
    if halts is not None:
        checks.whole("halts", halts, 0, 2**63)
    unit, address = known.addresses.unit(unit, changes=True), checks.address(address)
    words = checks.of_table(table, value)
    checks.flag("urgent", urgent)
    known.check(unit, tables.place(str(table), address), words, checks.flag("force", force))
    return unit, address, words


def broadcast_of(known: Units, address: int, value: int | Sequence[int], force: bool) -> tuple[int, int | list[int]]:
    """What a broadcast is of. Raises `NotAllowed` as `write_of` does, for all units that are known."""
    address, words = checks.address(address), checks.payload(value)
    known.check(0, address, words, checks.flag("force", force))
    return address, words


def echo_of(known: Units, unit: int, word: int | None) -> tuple[int, int | None]:
    """What an echo is of. Raises `NotAllowed` where something is out of range."""
    if word is not None:
        word = checks.whole("word", word, 0, 0xFFFF, hexadecimal=True)
    return known.addresses.unit(unit), word


def transact_of(
    known: Units, unit: int, pdu: bytes | bytearray | memoryview, reply_length: int | None, force: bool
) -> tuple[int, bytes, int | None]:
    """What any PDU is. Raises `NotAllowed` where something is out of range, or would be an unknown command."""
    try:
        body = bytes(memoryview(pdu))
    except TypeError:
        raise BadArgument(
            f"a PDU is bytes, and {checks.shown(pdu)} is not; give 1 to 253 bytes, function code first"
        ) from None
    if not 1 <= len(body) <= 253:
        raise BadArgument(f"a PDU of {len(body)} bytes is not allowed; give 1 to 253 bytes, function code first")
    if reply_length is not None:
        reply_length = checks.whole("reply_length", reply_length, 1, 253)
    unit = known.addresses.unit(unit, changes=not _native.only_reads(body))
    known.check_pdu(unit, body, checks.flag("force", force))
    return unit, body, reply_length


def seconds_of(seconds: float) -> float:
    """How long is waited. Raises `NotAllowed` where that is no time."""
    return checks.number("seconds", seconds, 0.0)
