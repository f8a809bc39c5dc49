"""What the Rust core offers to the Python package.

Everything here converts and decides nothing. Programs use `drivebus`, not this module.
Errors are those of `drivebus.errors`; `NotAllowed` always means that nothing was sent.
"""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Generic, Literal, TypeAlias, TypeVar, final

from typing_extensions import Buffer

from drivebus.errors import Decision

_T_co = TypeVar("_T_co", covariant=True)
_Piece: TypeAlias = tuple[str, bytes, float, float, float | None, float, float | None, str | None]
_Answer: TypeAlias = tuple[int, int | None, int | None]
_Writable: TypeAlias = tuple[str, int, list[int] | None, str, int | None, str, int | None]
_Named: TypeAlias = tuple[Profile, Sequence[str], bool, bool]
"""A profile, the commands that halt, whether its name is trusted, and whether what is not verified is done."""

__version__: Final[str]
__all__ = [
    "HALT_WITHIN",
    "STANDSTILL",
    "STORES_BEFORE_NOTICE",
    "Asked",
    "Batch",
    "Bus",
    "BusTimeout",
    "DeviceQuestion",
    "Family",
    "Gateway",
    "Halt",
    "Identity",
    "Looks",
    "Mailbox",
    "Plan",
    "Poller",
    "Profile",
    "Record",
    "Requests",
    "Rule",
    "SameUnit",
    "SerialFormat",
    "SimulatedDrive",
    "SimulatedLine",
    "Simulator",
    "Sniffer",
    "Task",
    "Unit",
    "Values",
    "__version__",
    "all_frames_in",
    "begin_families",
    "begin_of_child",
    "check_port_options",
    "code_places",
    "code_rows",
    "commanded_at",
    "crc16",
    "decode",
    "decode_answer",
    "device_objects",
    "encode_echo",
    "encode_read",
    "encode_write",
    "end_of_program",
    "exception_means",
    "fault_kinds",
    "forbidden",
    "frame_len",
    "frames_in",
    "halt_all",
    "huanyang_form",
    "identify",
    "is_write",
    "judge",
    "listed_codes",
    "may_be_of",
    "misses",
    "only_reads",
    "open_bus",
    "port_facts",
    "port_url",
    "read_sheet",
    "run_time_folder",
    "touched",
    "usable",
]

"""Seconds of the line's clock in which the frequency of a motor that stops must fall: even a ramp of an hour takes off
a hundredth of a hertz in that time."""

HALT_WITHIN: Final[float]
STORES_BEFORE_NOTICE: Final[int]
"""Seconds for which a halt is sent that is not taken, where nothing else is said."""

STANDSTILL: Final[float]
"""Output frequency in Hz up to which a drive that has stopped counts as stopped."""

def crc16(data: Buffer, /) -> int:
    """CRC-16/MODBUS of *data*: 0..=0xFFFF. On the wire its low byte goes first."""

def read_sheet(data: bytes, texts: Sequence[str], /) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The table in *data*: its titles, and each row that holds something with its line, from 1.

    UTF-8, or UTF-16 with its mark; cells divided by commas, semicolons or tabs. A decimal comma becomes a point, but in
    the columns *texts*. What stands behind the last end of a line is left out.

    Raises:
        NotAllowed: It is no such text, or a number in it may mean two things; the message has the line.
    """

def encode_read(unit: int, address: int, count: int) -> bytes:
    """A whole 03H request frame: *unit* 1..=247, *address* 0..=0xFFFF, *count* 1..=125 words."""

def encode_write(unit: int, address: int, value: int | Sequence[int]) -> bytes:
    """A whole 06H (an int) or 10H (a sequence of 1..=123 ints) request frame.

    *value* 0..=0xFFFF each; *unit* 1..=247, or 0 for a broadcast.
    """

def encode_echo(unit: int, word: int) -> bytes:
    """A whole 08H/0000 request frame with *word* 0..=0xFFFF."""

def decode_answer(request: Buffer, frame: Buffer) -> list[int] | None:
    """The words that *frame* answers to *request*; None for a confirmed write or echo, and for any other function.

    Answers of other functions are held to what the specification says of them: byte count, and what they repeat.

    Raises CrcError, BadAnswer, Refused; NotAllowed where *request* is no request.
    """

def decode(frame: Buffer) -> dict[str, Any]:
    """Any frame as fields: `unit`, `function`, `kind`, `crc`, and those of its kind.

    `kind` is `"read"`, `"write"`, `"write_many"`, `"echo"` (requests and answers that look alike),
    `"read_answer"`, `"write_many_answer"`, `"exception"`, `"other"`. Raises CrcError, BadAnswer.
    """

def device_objects(pdu: bytes, /) -> list[tuple[int, bytes]] | None:
    """The objects of one answer to 2BH/0EH, by their numbers; None of any other PDU."""

def touched(pdu: Buffer, /) -> tuple[int, int, list[int] | None] | None:
    """What the request *pdu* reads or writes: the first place, how many, and the words that it writes.

    Of a coil these are 0 or 1. Also where its counts are wrong, which a unit may not look at. None: it is no read or
    write of registers or bits.
    """

def is_write(pdu: Buffer, /) -> bool:
    """Whether the request *pdu* may change something in the unit, by its function: what is no request may."""

def only_reads(pdu: Buffer, /) -> bool:
    """Whether the request *pdu* only reads, whatever the unit makes of it: by its function and its form."""

def frame_len(data: Buffer, /) -> int | None:
    """How many bytes at the front of *data* are a whole frame of a function that tells its length.

    As a request or as an answer, with the CRC right; None where none is.
    """

def judge(frame: Buffer) -> tuple[bool, bool, str | None]:
    """Whether a master, and whether a unit, may have sent *frame*, and what is wrong inside.

    Of a frame that is wrong inside, they say of which of the two it has the form, if of any; its CRC is right. Raises
    CrcError, BadAnswer.
    """

def misses(request: Buffer, frame: Buffer) -> str | None:
    """How *frame*, of the unit and function of *request*, misses what that asks for, in words.

    None where it answers that, or something else.

    Raises CrcError, BadAnswer.
    """

def frames_in(data: Buffer, /) -> list[tuple[int, int]]:
    """Where the whole frames in *data* stand, start and end, whatever stands between them.

    Those with a length that their function gives, a good CRC, and nothing wrong inside.
    """

def all_frames_in(data: Buffer, /) -> list[tuple[int, int]]:
    """The same, and between them those that are surely of Huanyang's own protocol."""

def huanyang_form(data: Buffer, /) -> tuple[bool, bool]:
    """Whether *data* is a whole frame of Huanyang's own protocol, and whether it is surely none of Modbus."""

def may_be_of(unit: int, data: Buffer, /) -> bool:
    """Whether *data*, which came where *unit* was asked, may hold an answer of it, whole or damaged."""

def port_facts(
    path: str | os.PathLike[str],
    *,
    by_id: str | os.PathLike[str] | None = None,
    tty_class: str | os.PathLike[str] | None = None,
) -> dict[str, Any]:
    """What the system tells of the port at *path* without opening it.

    `driver`, `adapter`, `latency_timer_ms`, `latency_rule` (each may be None), `holders`. *by_id* and *tty_class* are
    other folders than this machine's.
    """

def port_url(
    port: str,
    /,
    *,
    schemes: Sequence[str],
    families: Sequence[str],
    faults: Sequence[str],
) -> tuple[str, dict[str, Any]]:
    """What *port* is, before anything is opened: its scheme (`""` of a path), and of `sim://` what `Simulator` takes.

    *schemes* are those that the caller opens itself, *families* and *faults* what a simulated line can have. NotAllowed
    names the part that is wrong and what is allowed there.
    """

def run_time_folder() -> str:
    """The folder for the sockets of this user's programs. OSError where there is none."""

def check_port_options(port: str | None, rs485: bool, echo: str, /) -> None:
    """Raises NotAllowed for what cannot be meant of *port*, which is None where it has no name."""

@final
class SerialFormat:
    """How characters look on the wire, and how long they take."""

    def __new__(
        cls,
        baudrate: int = 19200,
        parity: str = "E",
        stopbits: int = 1,
        bytesize: int = 8,
        silence: str | float = "spec",
    ) -> SerialFormat: ...
    @property
    def baudrate(self) -> int:
        """Bits per second."""
    @property
    def parity(self) -> str:
        """`"N"`, `"E"` or `"O"`."""
    @property
    def stopbits(self) -> int:
        """1 or 2."""
    @property
    def bytesize(self) -> int:
        """7 or 8."""
    @property
    def silence(self) -> str | float:
        """`"spec"`, `"characters"`, or seconds."""
    @property
    def bits_per_char(self) -> int:
        """Start, data, parity and stop bits."""
    @property
    def char_time(self) -> float:
        """Seconds for one character."""
    @property
    def t15(self) -> float:
        """Longest gap inside a frame, in seconds."""
    @property
    def t35(self) -> float:
        """Shortest silence between frames, in seconds."""
    def __eq__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...

@final
class Bus:
    """One line and its owner. Every method is safe from any thread and lets go of the GIL."""

    def __new__(
        cls,
        port: object,
        format: SerialFormat,  # noqa: A002
        *,
        timeout: float = 0.5,
        retries: int = 2,
        read_only: bool = False,
        rs485: Mapping[str, object] | None = None,
        echo: str = "auto",
        turnaround: float = 0.1,
        learn_timeout: bool = False,
        low_latency: bool = True,
        queue: int = 65_536,
        share: str = "auto",
        group: int | None = None,
        realtime: bool = False,
    ) -> Bus:
        """Opens *port*.

        A path, `socket://host:port`, `tcp://host:port`, a `Simulator`, or an object like `serial.Serial`.
        """
    @property
    def port(self) -> str:
        """The name of the port, for messages."""
    @property
    def closed(self) -> bool: ...
    @property
    def virtual(self) -> bool:
        """Whether the line's clock is a simulation's, which moves only while somebody waits."""
    @property
    def read_only(self) -> bool: ...
    def watch(self, function: Callable[[float, float | None, bool, bytes, bool], object] | None, /) -> None:
        """Calls *function* for each frame on the line from now on, or nothing any more.

        It is given the moment on the line's clock and the time since what went before, both in seconds, whether the
        frame was sent, its bytes, and whether another program has the port.
        """
    def close(self) -> None:
        """Closes the port. Closing again does nothing."""
    def step_aside(self, meanwhile: Callable[[], object], /) -> None:
        """Gives the port up while *meanwhile* runs, and opens it again when something is asked next."""
    def now(self) -> float:
        """Seconds on the line's clock: real time, or the simulation's."""
    def sleep(self, seconds: float, /) -> None:
        """Waits on the line's clock; a signal ends it at once."""
    def listen(self, seconds: float, /) -> list[tuple[float, bytes]]:
        """What comes while nothing is asked: pieces, each with its moment on the line's clock."""
    def overhear(self, function: Callable[[float, bool, bytes], object], /) -> None:
        """Calls *function* with all that goes over the line, until it returns something true.

        It is given a moment on the line's clock, whether this bus (or the program that has the port) sent it, and the
        bytes as they were handed over; no bytes where only time has passed. Raises what it raises, and PortError.
        """
    def read(
        self,
        unit: int,
        address: int,
        count: int,
        /,
        *,
        timeout: float | None = None,
        retries: int | None = None,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
    ) -> list[int]:
        """03H: *count* words (1..=125) of *unit* (1..=247) from *address*.

        *table*: `holding`, `input` (04H), `coil` (01H), `discrete` (02H); of the last two 1..=2000 bits, each 0 or 1.
        *urgent*: before all who wait. *verify*: until the same words came twice in a row.
        """
    def read_stamped(
        self,
        unit: int,
        address: int,
        count: int,
        /,
        *,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
    ) -> tuple[list[int], float, float]:
        """As `read`, with the Unix times at which the request left and the answer was complete."""
    def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        /,
        *,
        timeout: float | None = None,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        halts: int | None = None,
        table: str = "holding",
    ) -> None:
        """06H (int) or 10H (sequence); a `coil` 05H. Sent once, *urgent* before all who wait, whatever is in doubt.

        With *read_back*, the address where the words can be read, a missing confirmation is looked for there, and the
        write is repeated only while the unit shows other words. With *connection*, the `reconnects` that the caller
        knows, nothing is sent where the port was opened again since: PortError.
        """
    def configure(self, unit: int, /, *, timeout: float | None = None, gap: float | None = None) -> None:
        """What *unit* needs otherwise than the bus, in seconds; None keeps what the bus has."""
    def set_profile(self, unit: int, profile: Profile, /) -> None:
        """*unit* speaks the protocol of *profile*, and its exceptions mean what that says; until then as in Modbus."""
    def halts(self, unit: int, /) -> int:
        """A number that is another one each time *unit* is told to halt; see `Requests.halts`."""

    def link(self, unit: int, /) -> tuple[int, int]:
        """Of the last exchanges with *unit*, ten at most: how many brought an answer, and how many there were."""
    def leave_will(
        self,
        unit: int,
        ways: Sequence[Sequence[bytes]],
        /,
        *,
        look: tuple[bytes, Sequence[bytes]] | None = None,
        silence: float = 0.0,
        named: _Named | None = None,
    ) -> int | None:
        """Leaves what halts *unit* when this program is gone without a word: the number of that will, or None.

        None where nobody would find it. *ways* are PDUs that follow each other, each a way to halt; *look* a read and
        the answers by which the unit says that it is another one; *silence* the drive's own time-out in seconds. A
        unit that is *named* as one of a shipped family is halted by what that knows, and not frame by frame.
        """
    def withdraw_will(self, number: int, /) -> None:
        """Takes that will back."""
    @property
    def reconnects(self) -> int:
        """How often the port was opened again after it was lost."""
    def broadcast(self, address: int, value: int | Sequence[int], /) -> None:
        """06H or 10H to every unit; returns after the turnaround delay."""
    def echo(self, unit: int, word: int | None = None, /, *, timeout: float | None = None) -> float:
        """08H/0000; the round trip in seconds on the line's clock."""
    def transact(
        self,
        unit: int,
        pdu: Buffer,
        reply_length: int | None = None,
        /,
        *,
        timeout: float | None = None,
        in_doubt: bool = False,
        retries: int | None = ...,
    ) -> bytes:
        """Any PDU out, the answer's PDU back. *reply_length* is the length of that PDU, if known.

        *in_doubt*: also to a unit that may still owe another answer. What comes may be that. *retries*: how often an
        identification is asked for once more; anything else is sent once. None: as often as a read of this bus.
        """
    def stats(self) -> dict[str, Any]:
        """`{"requests": …, …, "hints": ["…"], "hint_names": ["no_bias"], "units": {1: {…}}}`.

        Counters are ints, latencies seconds.
        """

@final
class Mailbox:
    """Where the threads of the core leave what is meant for one event loop."""

    def __new__(cls) -> Mailbox: ...
    def fileno(self) -> int:
        """A socket that is readable when something was left; it lasts as long as this does."""
    def detach_socket(self) -> int:
        """The same socket once more, for the caller to close."""
    def take(self) -> list[tuple[int, Any, BaseException | None]]:
        """All that was left since: a number, and the value or the exception that belongs to it."""

@final
class Asked(Generic[_T_co]):
    """Something that was asked for an event loop, and of what kind the answer is."""

    @property
    def number(self) -> int:
        """Under which its answer comes."""
    def abandon(self) -> None:
        """It is no longer wanted: what still waits is not sent, and what is on the wire is not repeated."""

@final
class Requests:
    """A bus, as an event loop uses it: nothing here waits, and what comes is left in the mailbox.

    Arguments as those of `Bus`.
    """

    def __new__(cls, bus: Bus, mailbox: Mailbox) -> Requests: ...
    def read(
        self,
        unit: int,
        address: int,
        count: int,
        /,
        *,
        timeout: float | None = None,
        retries: int | None = None,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
    ) -> Asked[list[int]]: ...
    def read_stamped(
        self,
        unit: int,
        address: int,
        count: int,
        /,
        *,
        urgent: bool = False,
        verify: bool = False,
        table: str = "holding",
    ) -> Asked[tuple[list[int], float, float]]: ...
    def write(
        self,
        unit: int,
        address: int,
        value: int | Sequence[int],
        /,
        *,
        timeout: float | None = None,
        urgent: bool = False,
        read_back: int | None = None,
        connection: int | None = None,
        halts: int | None = None,
        table: str = "holding",
    ) -> Asked[None]: ...
    def broadcast(self, address: int, value: int | Sequence[int], /) -> Asked[None]: ...
    def echo(self, unit: int, word: int | None = None, /) -> Asked[float]: ...
    def transact(
        self,
        unit: int,
        pdu: bytes,
        reply_length: int | None = None,
        /,
        *,
        timeout: float | None = None,
        in_doubt: bool = False,
        retries: int | None = ...,
    ) -> Asked[bytes]: ...
    def halts(self, unit: int, /) -> Asked[int]: ...
    def link(self, unit: int, /) -> Asked[tuple[int, int]]: ...
    def sleep(self, seconds: float, /) -> Asked[None]: ...
    def listen(self, seconds: float, /) -> Asked[list[tuple[float, bytes]]]: ...
    def close(self) -> Asked[None]: ...

def open_bus(
    mailbox: Mailbox,
    port: object,
    format: SerialFormat,  # noqa: A002
    *,
    timeout: float = 0.5,
    retries: int = 2,
    read_only: bool = False,
    rs485: Mapping[str, object] | None = None,
    echo: str = "auto",
    turnaround: float = 0.1,
    learn_timeout: bool = False,
    low_latency: bool = True,
    queue: int = 65_536,
    share: str = "auto",
    group: int | None = None,
    realtime: bool = False,
) -> Asked[Bus]:
    """Opens a `Bus` in a thread of its own, and leaves it in *mailbox*."""

@final
class Rule:
    """What may be asked of units of one family, under one trust.

    Each answer is None where it may, or a kind of reason and what the profile says of it, which may be empty. Kinds are
    `no_address`, `only_written`, `not_printed`, `no_range`, `no_command`, `no_state` and `no_fault`.
    """

    def __new__(cls, profile: Profile, trusts_all: bool, /) -> Rule: ...
    def read(self, name: str, /) -> tuple[str, str] | None:
        """NotAllowed: there is no such name."""
    def write(self, name: str, /) -> tuple[str, str] | None:
        """NotAllowed: there is no such name."""
    def word(self, name: str, word: int, /) -> tuple[str, str] | None:
        """NotAllowed: there is no such name."""
    def bits(self, name: str, field: str, /) -> tuple[str, str] | None:
        """Of the bits *field* in the word *name*. NotAllowed: there is no such name, or it has no such bits."""
    def kept(self, name: str, store: bool, /) -> tuple[str, str] | None:
        """Of *name*, written to be kept for good, or else in RAM alone. NotAllowed: there is no such name."""
    def variant(self, name: str, /) -> tuple[str, str] | None:
        """NotAllowed: there is no such variant."""
    def command(self, name: str, /) -> tuple[str, str] | None: ...
    def state(self) -> tuple[str, str] | None: ...
    def fault(self) -> tuple[str, str] | None: ...

@final
class Family:
    """One family of drives, by what its units answer and refuse.

    Places are numbers as `tables` has them, of a holding register its address. Answers are tuples of the place, the
    word that came or None, and the exception by which it was refused or None. What is to be sent is a command by its
    name, or a place that any word may be written to. NotAllowed: there is no such place or command.
    """

    def __new__(cls, profile: Profile, /) -> Family: ...
    def harmed(self, what: str | int, /) -> list[str]:
        """The shipped families that *what* does harm to where it is written to a unit named as one of this family."""
    def contradiction(self, answers: Sequence[_Answer], /) -> tuple[str, Any] | None:
        """What speaks against it.

        `"code"`: the place, the word, and the rows that are listed of it. `"no_address"` and `"no_function"`: the
        place, and the exception. `"signature"`: the families whose signature the unit has, of a `SameUnit` alone.
        """

@final
class Identity:
    """What a unit said of itself, asked in the words of one family; all handles of the unit have the same one.

    A connection is the `reconnects` of the line, and *now* its clock in seconds.
    """

    def settle(self, connection: int, now: float, /) -> None:
        """Takes it for surely what it was named as, for as long as the port stays open."""

@final
class SameUnit:
    """A unit that was named as one of a family."""

    def __new__(cls, unit: int, family: Family, identity: Identity, trusted: bool, /) -> SameUnit: ...
    def gave(self, code: int, now: float, /) -> None:
        """Takes it that the unit gave the identification code *code* (0..=0xFFFF) at *now*."""
    def check(self, judged: bool, urgent: bool, /) -> Task:
        """Asks the unit what it is, if the port was opened again or nobody has asked yet.

        Its result is `"same"` and the connection for which that holds. Or `"contradicts"` and what speaks against the
        family, as `Family.contradiction` has it; `"unsaid"` and the error of the line; `"put_off"` and what was told;
        `"another"`, what was told before and what is told now.
        """
    def contradiction(self) -> Task:
        """Asks the unit what it is. Its result is what speaks against the family, or None."""

def identify(unit: int, /) -> Task:
    """Finds out what *unit* is, by reads of one word each.

    Its result is `"found"` and what was found, by name: `candidates`, `family`, `code`, `titles`, `certainty`, and the
    `reason`. That is `"code"`, the place, the certainty by the code alone, its source, and an answer that speaks
    against it or None; `"answers"` and the places, each with whether it was answered; or `"nothing"` and the answers
    that came. Or its result is `"unreached"` and the exception of a gateway; or `"busy"`, the place, the last
    exception, how often the unit refused, and the last error.
    """

def usable(certainty: str, candidates: Sequence[str], unverified: bool, /) -> str | None:
    """The shipped family of *candidates* that a unit surely enough is to command a motor by it."""

@final
class Looks:
    """What is looked at of units of one family: what a drive is doing.

    What no document of the family prints is left out, unless it is trusted. Each task is for one unit (0..=255), asks
    before all who wait where it is urgent, and fails as the bus does.
    """

    def __new__(cls, profile: Profile, trusted: bool, /) -> Looks: ...
    @property
    def is_blind(self) -> bool:
        """Whether nothing of the state may be read."""
    @property
    def state(self) -> str | None:
        """The name of the state word that is read; None where that may not be."""
    @property
    def fault(self) -> str | None:
        """The name of the register of the present fault that is read; None where that may not be."""
    def read_off(self, state: int | None, fault: int | None, /) -> tuple[str, int, bool]:
        """What the words say, None of what is not known: the state, the number of the fault, whether it is in that."""
    def look(self, unit: int, urgent: bool, /) -> Task:
        """Comes to what the unit is doing.

        That is the state, its word or None, the number of the fault or None, whether it is in that, the bit fields with
        what they mean, and the Unix time at which the first of it was asked for.
        """

@final
class Task:
    """An operation on its way: it wishes for something, and goes on with what came of that."""

    def step(
        self, now: float, connection: int, closed: bool, outcome: Sequence[Any] | Exception | None = None, /
    ) -> tuple[str, Any]:
        """Goes on until it wishes for something, or is done.

        Args:
            now: Seconds on the line's clock. A moment before the last one counts as that.
            connection: The `reconnects` of the line.
            closed: Whether the line was closed for good.
            outcome: What came of the last wish: words of a read, with their moments where that is stamped, or an error
                of the line; how many of the last exchanges of a link were good, and how many there were; a number of
                halts or None, in a tuple; None at the first step, where a sleep is over, a write was confirmed, or a
                notice was heard.

        Returns:
            `"read"` or `"stamped"` and the arguments of a `drivebus.line.asking.Read`; `"write"` and those of a
            `drivebus.line.asking.Write`; `"sleep"` and seconds of the line's clock; `"link"` or `"halts"` and a unit;
            the notice `"took"` and a command that the unit took, `"saw"` and what `Looks.look` comes to, `"shows"` and
            a state, `"took_other"`, a command, the word that the unit took for it, and what is told of
            `"set_otherwise"` in `Halt.carry_out`, `"stored"`, a code and how often that was written, or `"starts"` and
            a command that is about to be sent; or `"done"` and the result.

        Raises:
            DrivebusError: It failed; an error of the line that it does not handle comes back as it was given.
            RuntimeError: *outcome* is none of the last wish, or the task is done. It is as it was before.
        """
    @property
    def taken_for(self) -> tuple[int, str] | None:
        """Of which unit the last wish is, and as which family that is taken, by the name of its profile.

        Its refusals are told in the words of that family. None: nobody says so; a notice always has it.
        """

@final
class Record:
    """What was sent to one unit, and what it said of itself; all handles of the unit have the same one."""

    def __new__(cls) -> Record: ...
    def identity(self, family: str, connection: int, /) -> Identity:
        """What it said in the words of *family*, over *connection*, the `reconnects` of the line; nothing at first."""
    def is_in_ram(self, code: str, /) -> bool:
        """Whether the parameter *code* was written to RAM, and not to EEPROM since."""
    def put_in_ram(self, code: str, /) -> None:
        """The parameter *code* is about to be written to RAM."""
    def stored(self, code: str, /) -> int:
        """The parameter *code* was written to EEPROM. How often that was."""
    @property
    def starts(self) -> int:
        """How many starts were sent, or were about to be."""
    @property
    def halts(self) -> int:
        """How many halts have gone out."""
    @property
    def started_as(self) -> str | None:
        """The state that its last start was for; unknown after a jog or a raw write. None: it was not started."""
    @started_as.setter
    def started_as(self, state: str, /) -> None: ...
    @property
    def started_unverified(self) -> bool:
        """Whether it was started by what is not verified, and so may be stopped by that."""
    @started_unverified.setter
    def started_unverified(self, is_unverified: bool, /) -> None: ...

@final
class Unit:
    """One call to a unit: what it commands and writes, each sent once.

    The result of each task is `"done"` and what it says; or a kind of reason, and what is told of it, which is a kind
    and what is told of that again:

    `"not_commanded"` has the command or None, the line's clock when that was found, and the kind: `"not_ready"`,
    `"not_set"` and `"not_written"` as below; `"not_led_up"`, the number of the word of the start sequence, and a
    kind: `"halted_before"` or `"not_written"` as below, `"halted"`, `"tripped"` and a look as of `Looks.look`,
    `"port_lost"` and the error, or one of the last look; `"halted"` and the error; `"halted_between"` and the error
    or None; `"half_written"` and a kind as of `"not_written"`; `"unanswered"`, the error, and a look or the error
    instead of one; `"refused_and_turns"`, the error and a look; `"port_lost"` and the error; `"unshown"`, the last
    look and None, or `"unread"` and the error of that; `"ignored"`, settings, and a kind with what is told of it.

    `"not_ready"`: `"may_not"`, `"unseen"`, `"unstoppable"`; `"bad_link"`, how many of the last exchanges were good and
    how many there were, and how many looks failed of how many; `"settings"`, what it does otherwise (`"words"`,
    `"commands"`, `"speed"`) and settings; `"in_fault"`, `"no_voltage"`, `"unknown_state"`, `"other_source"`,
    `"turning"` and a look.

    `"not_set"`: `"no_register"`, `"may_not"`; `"not_settled"` as below; `"not_in_hz"` and the unit; `"above"`, a
    parameter and its value; `"not_written"`. `"not_settled"`: `"unproved"` or `"unreadable"` and the variant;
    `"unknown"`, the variant and the raw number. `"not_written"`: `"not_same"` and a result of `SameUnit.check`;
    `"harm"`, and `"may_be"` and the families that it may be, which may be none, `"set_otherwise"` as of `Halt`,
    `"busy"` as of `identify`, or `"failed"` and the error of the line; `"failed"` and the error.

    `"not_reached"`: `"unseen"`; `"untold"` and the role; `"tripped"`, whether the first look showed that, and a status;
    `"late"` and a status.

    A setting is its code, the word that it must hold, the number that it is or None, label, note, whether it is
    verified, and whether it is set by hand. A status is a look as of `Looks.look`, the output frequency and the
    setpoint, each None where the drive does not tell it, and the Unix time at which the first of it was asked for.
    """

    def __new__(cls, unit: SameUnit, looks: Looks, record: Record, /) -> Unit:
        """The *unit* as it was named, the *looks* of its profile, whose trust counts for all, and its *record*."""
    @property
    def parts(self) -> int:
        """How many writes of this call the unit took."""
    def start(self, jogs: bool, reverse: bool, hz: float | None, confirm: float, force: bool, /) -> Task:
        """Starts the motor, or jogs it, at *hz*; its state is looked at for *confirm* seconds. Or `"not_commanded"`."""
    def reset_fault(self, confirm: float, /) -> Task:
        """Resets a fault, if there is one. Or `"not_commanded"`."""
    def write(
        self, place: int, value: int | Sequence[int], read_back: int | None, absolute: bool, force: bool, /
    ) -> Task:
        """Writes a word, or several, which can be read at *read_back*. Or `"not_written"`.

        Args:
            place: Where the first goes.
            value: What goes there.
            read_back: The place where the same can be read.
            absolute: Whether it is a value and no command, which is sent again where it was not taken.
            force: Whether it goes out also where the line knows the unit as one of a family that does not define it.
        """
    def write_frequency(self, word: int, /) -> Task:
        """Writes the frequency, as the drive counts it. Or `"not_written"`."""
    def set_frequency(self, hz: float, /) -> Task:
        """Gives the frequency *hz*, up to the drive's own maximum. Or `"not_set"`."""
    def frequency_word(self, hz: float, /) -> Task:
        """*hz* as the drive counts it, up to its own maximum. Or `"not_set"`."""
    def settled(self, names: Sequence[str], /) -> Task:
        """All variants that are chosen, with those on which *names* depend. Or `"not_settled"`."""
    def status(self) -> Task:
        """What the drive does: a status. Or `"not_settled"`."""
    def wait_for_speed(self, hz: float | None, tolerance: float, timeout: float, /) -> Task:
        """Waits until the motor runs at *hz*, None: its setpoint. A status; or `"not_reached"`, `"not_settled"`."""
    def wait_until_stopped(self, timeout: float, /) -> Task:
        """Waits until the motor stands. A status; or `"not_reached"`, `"not_settled"`."""
    def comes_to_rest(self) -> Task:
        """Waits while the motor slows down: whether it rests then. Or `"unseen"`: its state may not be used."""
    def control(self, setpoint: str, /) -> Task:
        """What must be set so that the bus commands the drive, and gives it *setpoint*: settings."""

@final
class Values:
    """The values of a unit as one call to it writes them, by name.

    The result of each task is `"done"` and what it says; or a kind of reason, and what is told of it, which is a kind
    and what is told of that again, as of `Unit`, and besides:

    `"not_kept"` has the names that were written before, and the kind: `"not_planned"`, the name, a kind (`"read_only"`,
    `"moves"`, `"stores"`, `"may_not"`, `"only_stored"`, `"no_range"`, `"may_not_keep"`) and the word whose range is not
    printed; `"decides"`, the name and another whose meaning it decides; `"unsays"`, the name, a variant and what that
    was said to be; `"not_settled"`; `"running"`, names and the state; `"beyond"`, a name with its value and unit, the
    same of its limit, and whether it is below; `"not_written"`, the names of the request, why, and None or what is in
    force: `"shown"` and names with their values and units, or `"unread"` and the error; `"not_stored"`, and `"may_not"`
    and why, `"unread"` or `"unseen"` and the error, `"not_idle"` and what stands there and should, `"late"` and what
    still does, or `"not_written"` and why; `"failed"` and the error.

    `"not_prepared"`: `"no_setpoint"`; `"by_hand"` or `"may_not"` and a setting; `"not_kept"`; `"unshown"` and settings.
    `"not_given"`: `"no_register"`; `"ignored"` and settings; `"not_kept"` without names. `"not_set_bits"`:
    `"no_register"`, `"may_not"`, `"nothing_named"`, `"unreadable"`; `"no_field"`, the name and those that there are;
    `"unfit"`, the name and what it can be, by number; `"unproved"` and the name; `"not_ready"`; `"ignored"` and
    settings; `"not_written"`.
    """

    def __new__(cls, unit: Unit, /) -> Values:
        """Those of *unit*."""
    def write(self, wanted: Sequence[tuple[str, object]], store: bool, /) -> Task:
        """Writes values, to EEPROM where *store*. Or `"not_kept"`."""

    def store(self, /) -> Task:
        """Stores all that is in RAM, where the family has a word for that. Or `"not_stored"`, as in `"not_kept"`."""
    def prepare(self, setpoint: str, store: bool, /) -> Task:
        """Sets the drive to obey the bus, and to take *setpoint* from it: settings. Or `"not_prepared"`."""
    def give_setpoint(self, setpoint: str, value: float, /) -> Task:
        """Gives a setpoint, if the drive heeds it. Or `"not_given"`."""
    def set_bits(self, setpoint: str, fields: Sequence[tuple[str, bool | int | str]], force: bool, /) -> Task:
        """Sets bits of a word, over a bad link too where *force*. Or `"not_set_bits"`, `"not_commanded"`."""

@final
class DeviceQuestion:
    """What to ask a unit next for its identification (2BH/0EH)."""

    def __new__(cls) -> DeviceQuestion: ...
    def pdu(self) -> bytes | None:
        """The PDU to ask with now; None once it is known."""
    def heard(self, pdu: bytes, /) -> None:
        """The unit gave this answer."""
    def refused(self, code: int, /) -> bool:
        """The unit refused; whether there is something less to ask for."""
    def told(self) -> tuple[int, bool, list[str | None], dict[int, bytes]]:
        """What came: conformity, whether that is all, the first seven objects as text, and all as bytes."""

@final
class BusTimeout:
    """A drive's own time-out of the bus: what is set in it, and what it had before.

    The result of each task is `"done"`; or a kind of reason, and what is told of it, as of `Values`, and besides:

    `"not_armed"` has the kind: `"may_not"` and a name; `"not_settled"`; `"failed"` and the error; `"not_kept"`;
    `"others"` and names with the values and units that are shown. What is told of that, whether the unit has a part of
    it, and None or what `"not_kept"` tells, if it could not be given back what it had. `"not_asked"` has the error, or
    None where nothing of the unit may be read, and whether the line was closed for good.
    """

    @staticmethod
    def of(rule: Rule, timeout: object, action: object, /) -> tuple[str, Any]:
        """`"done"` and the time-out of *timeout* seconds, after which the drive does *action*. Nothing is sent.

        Or why that may not be: `"no_timeout"`; `"only_stored"`; `"not_printed"`; `"out_of_range"` and the longest or
        None; `"no_action"`. NotAllowed: the drive does not count such a time.
        """
    @property
    def seconds(self) -> float:
        """Seconds of silence after which the drive acts."""
    @property
    def action(self) -> str:
        """What it then does: `"coast"`, `"stop"` or `"trip"`."""
    @property
    def is_armed(self) -> bool:
        """Whether the drive acts by itself when it hears nothing."""
    @property
    def may_be_set(self) -> bool:
        """Whether the drive may have some of it: then a `set` that did not come to its end is put back."""
    @property
    def interval(self) -> float:
        """Seconds between two questions that keep the drive from acting."""
    def set(self, unit: Unit, /) -> Task:
        """Sets it, and reads it back. Where that fails the unit gets back what it had. Or `"not_armed"`."""
    def put_back(self, unit: Unit, /) -> Task:
        """Gives the unit what it had. Or `"not_kept"`."""
    def ask(self, unit: Unit, /) -> Task:
        """Asks for one word. Or `"not_asked"`."""

@final
class Halt:
    """One unit that is to be halted: sent until it takes it, and proved."""

    def __new__(
        cls,
        unit: SameUnit,
        looks: Looks,
        record: Record,
        command: str,
        coasts: bool,
        within: float,
        confirm: float,
        /,
    ) -> Halt:
        """Nothing is sent yet.

        Args:
            unit: The unit, as it was named.
            looks: Those of its profile, whose trust counts for the command too.
            record: What is remembered of it.
            command: What is sent. NotAllowed: there is no such command.
            coasts: Whether each fourth frame is a coast.
            within: Seconds for which it is sent until it is taken.
            confirm: Seconds for which its state is looked at; 0 does not look.
        """
    def carry_out(self) -> Task:
        """Halts it. The result is `"done"` and nothing, or `"not_halted"` and why.

        That is the family that it is taken for, the command sent last, when that was found, and the kind of the reason
        with what is told: `"may_not"`; `"undecided"`, the command that was wanted, and families; `"set_otherwise"`, the
        command that was wanted, and what its words depend on (the parameter, what it holds, what it must hold, what
        that is called, what the words mean as it is, or an empty text, and a note); `"unsaid"`;
        `"not_sent"` and the error; `"refused"` or `"unanswered"`, the error, how often it was sent (the commands, in
        how many seconds, and how many seconds ago the unit was heard or None), and a look as of `Looks.look` or the
        error instead of one; `"unasked"` and the error; `"another"`, what speaks against its name or None, and a kind
        with what is told of it, which may be `"failed"` and an error; `"port_lost"` and the error; `"unshown"`, the
        last look, and the frequency in Hz or None; or `"unread"` and the error of the last look.
        """

def halt_all(halts: Sequence[Halt], /) -> Task:
    """Halts units that hang on one line, side by side.

    The result is what `Halt.carry_out` comes to for each, in their order. A kind may be `"failed"`, too, with an error
    that says nothing of the unit.
    """

def begin_families() -> None:
    """Begins to work out the shipped families, which a drive needs, in a thread that ends by itself."""

def code_places() -> list[int]:
    """Where units of the shipped families keep their codes."""

def code_rows(place: int, word: int, /) -> list[dict[str, Any]]:
    """What the shipped profiles list of the code *word* (0..=0xFFFF), if codes stand at *place*."""

def listed_codes() -> list[int]:
    """Every code that a shipped profile lists."""

_Undefined: TypeAlias = tuple[Literal["undefined"], str, int, int, dict[int, str]]
_Foreign: TypeAlias = tuple[Literal["foreign"], str, int, int | None, list[str]]

def forbidden(families: Sequence[Family], place: int, words: int | Sequence[int], /) -> _Undefined | _Foreign | None:
    """Why *words* (each 0..=0xFFFF) may not be written from *place* on to a unit that may be one of *families*, if so.

    `undefined`: the title of the first of them that has commands there, the place, the word, and its codes by name.
    `foreign`: the title of the first of them, the place, where it takes its commands, and the titles of the families
    that take theirs there. NotAllowed: there is no such place or word.
    """

def commanded_at(place: int, /) -> list[str]:
    """The titles of the shipped families that take commands at *place*. NotAllowed: there is no such place."""

@final
class Profile:
    """What one family of drives means by its registers."""

    @staticmethod
    def builtin(name: str, /) -> Profile:
        """A shipped profile. NotAllowed names the closest one if it is misspelt."""
    @staticmethod
    def builtin_names() -> list[str]: ...
    @staticmethod
    def load(folder: str | os.PathLike[str], /) -> Profile:
        """A folder with `profile.toml` and the CSV files. NotAllowed names file, line and reason."""
    @staticmethod
    def schema() -> str:
        """The JSON schema of `profile.toml`."""
    @staticmethod
    def check(folder: str | os.PathLike[str], /) -> list[tuple[str, int | None, str]]:
        """All that is wrong with a folder: file, line (None where a file cannot be read) and reason of each."""
    @property
    def name(self) -> str: ...
    @property
    def family(self) -> str:
        """The name; for an overlay that of the profile below it."""
    @property
    def kind(self) -> str:
        """`"inverter"` or `"rectifier"`."""
    @property
    def version(self) -> int: ...
    @property
    def source(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def maker(self) -> str:
        """Empty where the profile does not say."""
    @property
    def models(self) -> list[str]: ...
    def aliases(self) -> list[tuple[str, str, str]]:
        """Name, note and source of each."""
    @property
    def functions(self) -> list[int]: ...
    def requests(self) -> dict[str, Any]:
        """What is known beside lengths: `protocol`, `joined`, `across_groups`, `single_parameters`, and more."""
    def serial(self) -> dict[str, Any] | None:
        """`baud_rate`, `format`, `unit` (or None), `response_delay` in seconds, `verified`, `source`."""
    @property
    def max_words(self) -> int:
        """Most words in one read or write."""
    def parameter_groups(self) -> list[int]:
        """The groups in which a code is its own address, 0..99; without closed ones and those where registers stand."""
    def unlisted_groups(self) -> list[int]:
        """These, and the high bytes of other addresses at which there may be parameters without a row."""
    def role(self, role: str, /) -> str | None:
        """The register with a role: `state`, `fault`, `frequency`, `setpoint`, `deceleration`, one of `setpoints`."""
    def status_words(self) -> list[str]:
        """The words whose bit fields tell more of the state."""
    def reports_as(self) -> list[str]:
        """The families whose identification codes a unit may report, its own first."""
    def identifications(self) -> list[dict[str, Any]]:
        """`code`, `family`, `title`, `shared`, `verified`, `note`, `source` of each code."""
    def signature(self) -> tuple[list[int], list[int]] | None:
        """The addresses that such a unit answers, and those that it refuses."""
    def identify(self, code: int, /) -> str | None:
        """The family that register 2103H names with *code*, by this profile's list; None if unknown."""
    def names(self) -> list[str]:
        """Every register name and parameter code, registers first, in address order."""
    def search(self, text: str, limit: int) -> list[str]:
        """Names and codes in which all words of *text* occur, the best first."""
    def fault_values(self) -> list[str]: ...
    def acts(self) -> list[str]: ...
    def serial_parameters(self) -> list[str]: ...
    def motor_parameters(self) -> list[str]: ...
    def last_parameters(self) -> list[str]: ...
    def counts(self) -> dict[str, dict[str, int]]:
        """`registers`, `parameters`, `faults`: `total`, `sourced`, `unsourced`, `unverified`, `assumed`."""
    def monitor_names(self) -> list[str]:
        """The registers that `Drive.monitor()` reads when it is given no names."""
    def fault_history(self) -> list[str]:
        """The parameters that hold the last faults, the latest first."""
    def describe(self, name: str, /) -> dict[str, Any]:
        """Everything that is known about one register or parameter.

        Keys: `name`, `code` (or None), `label`, `kind` (`"register"` or `"parameter"`), `address`, `unit`, `scale`,
        `signed`, `low`, `high`, `low_from`, `high_from` (parameters that narrow the range), `default`,
        `access` (`"rw"`, `"ro"`, `"run"`, `"stop"`, `"unknown"`),
        `choices` ({int: str}), `bits` ({str: {int: str}} or None), `source`, `verified`, `evidence`, `note`, `words`,
        `high_first`, `variant`. `address` is None where nobody knows it; `scale` is a float where 16384 are 100 %.
        """
    def address(self, name: str, /, *, store: bool | None = None) -> int:
        """The address of *name*; with *store* given, the one to write to for RAM (False) or EEPROM (True)."""
    def read_back(self, name: str, /) -> int | None:
        """Where a write to *name* can be read back; None if that would not show whether the drive took it."""
    def decode(self, name: str, raw: int, /) -> int | float:
        """*raw* (0..=0xFFFF, or 32 bits where it takes two words) in engineering units.

        An int where the drive counts or names, a float where it measures.
        """
    def encode(self, name: str, value: object, /) -> int:
        """*value* (int, float, Decimal, or a choice's label) as a word. NotAllowed names value, range and unit."""
    def fields(self, name: str, raw: int, /) -> dict[str, str]:
        """The bit fields of *raw* (0..=0xFFFF) in the profile's words, such as `{"motor": "motor 1"}`.

        A bit without words of its own is `"off"` or `"on"`; a register without bit fields has none.
        """
    def plan(self, names: Sequence[str], /) -> list[tuple[int, int]]:
        """The fewest reads (address, count) that hold all *names*."""
    def compile(self, names: Iterable[str], /) -> Plan:
        """The fewest reads that hold all *names*, with the way from their words to values. NotAllowed as `plan`."""
    def command(self, name: str, /) -> tuple[int, int]:
        """Address and code of a command.

        Commands are `run_forward`, `run_reverse`, `jog_forward`, `jog_reverse`, `stop`, `coast`, `reset_fault`,
        `jog_stop`.
        """
    def command_first(self, name: str, /) -> tuple[int, int] | None:
        """Place and word of what is written before a command, or None."""
    def command_reason(self, name: str, /) -> str | None:
        """Why a command is not verified."""
    def commands(self) -> dict[str, int]: ...
    def command_codes(self) -> dict[int, str]:
        """Every code that the family defines at its command register."""
    def command_registers(self) -> dict[int, dict[int, str]]:
        """Every register that takes commands, with its codes."""
    def start_sequence(self) -> list[dict[str, Any]]:
        """The words before a run: `word`, `label`, `until`, `mask`, `value`."""
    @property
    def command_address(self) -> int | None: ...
    @property
    def is_written_by_many(self) -> bool:
        """Whether a single word is written by 10H."""
    def stored_address(self, address: int, /) -> int | None:
        """The plain address behind one with the memory bit; None if *address* has not that bit."""
    def memory(self) -> dict[str, Any] | None:
        """`bit`, `means` (`"ram"`, `"eeprom"`), `reason` (None where verified), `source`."""
    def is_command(self, address: int, /) -> bool:
        """Whether a write to *address* can move a motor."""
    def state(self, raw: int, /) -> str:
        """State word 1 as `forward`, `reverse`, `stopped`, `fault`, `power_off`, `pre_exciting` or `unknown`."""
    def is_in_fault(self, raw: int, /) -> bool:
        """Whether state word 1 says that the drive is in fault, which it may run in."""
    def state_tells_fault(self) -> bool:
        """Whether the state word can say that the drive is in fault."""
    def rest_by_frequency(self) -> bool:
        """Whether a motor only rests once its output frequency is zero, too."""
    def state_reason(self) -> str | None:
        """Why the states are not verified."""
    def control(self) -> list[dict[str, Any]]:
        """What must be set before the drive obeys the bus, in order.

        Keys of each: `code`, `value`, `label`, `always` (asked before each start), `by_hand` (not set by
        `prepare_control`), `verified`, `note`, `source`.
        """
    def setpoint_names(self) -> list[str]: ...
    def needs(self, setpoint: str, /) -> list[dict[str, Any]]:
        """What must be set before the drive takes a setpoint; as `control`."""
    def variants(self) -> dict[str, dict[str, Any]]:
        """`parameter`, `choices`, `reason`, `source` of each."""
    @property
    def variants_chosen(self) -> dict[str, str]: ...
    def with_variants(self, chosen: Mapping[str, str], /) -> Profile:
        """The same for a drive of which the variants are known."""
    def watchdog(self) -> dict[str, Any] | None:
        """What makes the drive act when the bus falls silent, or None.

        Keys: `timeout` and `action` (parameter codes), `actions` (the value of `"coast"` and of `"stop"`, where the
        family has them), `verified`, `note`, `source`.
        """
    def fault_number(self, raw: int, /) -> int:
        """The number in the word of the present fault."""
    def fault(self, code: int, /) -> dict[str, Any]:
        """One fault: `code`, `mnemonic`, `label`, `cause`, `remedy`, `verified`, `evidence`, `note`, `source`.

        An unknown number says so in its label.
        """
    def faults(self) -> list[dict[str, Any]]: ...
    def exceptions(self) -> dict[int, tuple[str, str]]: ...
    def exception(self, code: int, /) -> tuple[str, str]:
        """Name and meaning of an exception code."""
    def exception_means(self, code: int, /) -> Decision:
        """Whether it is a decision: `"no_such"`, `"not_now"`, `"ask_again"` or `"taken"`."""

@final
class Plan:
    """What to read for some names, and where in the answers their values are."""

    @property
    def names(self) -> list[str]:
        """As they were given."""
    @property
    def reads(self) -> list[tuple[int, int]]:
        """Address and number of words of each read."""
    def values(self, answers: Sequence[Sequence[int]], /) -> list[int | float | None]:
        """The value of each name, in their order, out of the words that each read brought; None where it has nothing.

        Ints where the drive counts or names, floats where it measures.
        """

@final
class Gateway:
    """A server for Modbus TCP before a bus."""

    def __new__(
        cls,
        bus: Bus,
        address: str,
        within: float,
        /,
        *,
        rtu: bool,
        rules: list[tuple[list[str], list[int], list[int], list[_Writable]]],
        units: list[
            tuple[int, list[_Writable], list[list[bytes]], tuple[bytes, Sequence[bytes]] | None, _Named | None]
        ],
        dead_man: float | None,
        audit: str | None,
    ) -> Gateway:
        """Listens at once. PortError: not at *address*, or *audit* cannot be written.

        A rule is networks, units, functions, and what may be written; none: all may read. A unit has its stops and what
        halts it.
        """
    @property
    def address(self) -> str: ...
    def stats(self) -> dict[str, int]:
        """What `GatewayStats` has, by name."""
    def take_told(self) -> list[str]: ...
    def close(self) -> None: ...

@final
class Poller:
    """Reads that go on in cycles, in a thread of the core's own; in virtual time, in whoever waits."""

    def __new__(
        cls,
        bus: Bus,
        targets: Sequence[tuple[int, Plan | Sequence[tuple[int, int]]]],
        interval: float | None,
        size: int,
        /,
    ) -> Poller:
        """Begins at once. Each of *targets* is a unit (1..=247) and a plan, or addresses and numbers of words."""
    @property
    def shortest(self) -> float:
        """Seconds that one cycle takes at least; 0.0 where the line sets no such limit."""
    @property
    def over(self) -> bool:
        """Whether nothing is asked any more."""
    def counts(self) -> dict[str, int]:
        """`cycles`, `missing`, `late`, `dropped`."""
    def wait(self, count: int, timeout: float | None, /) -> int:
        """Waits until *count* samples are there, or it is over, for *timeout* seconds of the line's clock at most.

        Returns how many are there. A signal ends it at once.
        """
    def ask(self, mailbox: Mailbox, count: int, timeout: float | None, /) -> Asked[None]:
        """As `wait`, for an event loop. On a real line without the *timeout*, which the loop keeps itself."""
    def take(self, max: int, /) -> Batch:  # noqa: A002
        """The oldest samples, *max* at most, without waiting."""
    def stop(self) -> None:
        """Ends it without waiting for the exchange that is under way."""
    def close(self) -> None:
        """Ends it; what is there can still be taken. Closing again does nothing."""

@final
class Batch:
    """Samples that were taken out of a `Poller`."""

    def __len__(self) -> int: ...
    def samples(self) -> list[tuple[int, float, float, int, list[int | float | None] | None, Exception | None]]:
        """Each sample: its target by number, Unix times of request and answer, beats missed, values, error; or None."""
    def rows(self, target: int, /) -> bytearray:
        """Those of one target as doubles in native order: the two times and the values, NaN for what is missing."""

@final
class Simulator:
    """A simulated line with simulated drives."""

    def __new__(
        cls,
        units: Mapping[int, str | Profile],
        format: SerialFormat,  # noqa: A002
        *,
        seed: int = 0,
        transport: str = "pty",
        realtime: bool = True,
        strict_silence: bool = False,
        link: str | os.PathLike[str] | None = None,
        fifo: int | None = None,
        ear: bool = False,
        ear_link: str | os.PathLike[str] | None = None,
    ) -> Simulator:
        """*transport*: `"pty"`, `"tcp"` (RTU over TCP on 127.0.0.1), or `"process"` (only by `Bus(simulator)`).

        *realtime* False needs `"process"`: the clock jumps to what happens next. *link* is a symbolic link that is kept
        leading to the pseudo-terminal. *fifo*: after how many characters a port hands them over; 8 if it is not said.
        *ear*: whether there is a pseudo-terminal that overhears the line; *ear_link* leads to it, and asks for it.
        """
    @property
    def port(self) -> str:
        """A path, `socket://127.0.0.1:N`, or `sim:` and the units. A path changes with each `SimulatedLine.replug`."""
    @property
    def ear(self) -> str | None:
        """The path of the pseudo-terminal that overhears the line."""
    def close(self) -> None: ...
    def now(self) -> float:
        """Seconds since the simulation began."""
    def advance(self, seconds: float, /) -> None:
        """Lets virtual time pass. NotAllowed on a real-time simulation."""
    def drive(self, unit: int, /) -> SimulatedDrive: ...
    @property
    def line(self) -> SimulatedLine: ...

def exception_means(code: int, /) -> Decision:
    """Whether an exception (0..=255) is a decision by the specification: as `Profile.exception_means`."""

def end_of_program() -> None:
    """To be called last of all at exit, by the thread that ends the program; others raise SystemExit from here on.

    Waits up to 1 s for those that make an exception here, or use an object that stands for a port.
    """

def begin_of_child() -> None:
    """To be called in a forked child: its program has not ended, whatever was so in its parent."""

def fault_kinds() -> tuple[str, ...]:
    """The names of what can go wrong with an answer on a simulated line."""

@final
class SimulatedDrive:
    """One simulated drive, seen from its shaft and its keypad, not from the bus."""

    @property
    def unit(self) -> int: ...
    @property
    def profile(self) -> str: ...
    @property
    def state(self) -> str: ...
    @property
    def frequency(self) -> float:
        """Output frequency in Hz, negative in reverse."""
    @property
    def speed(self) -> float:
        """Shaft speed in rpm, negative in reverse."""
    @property
    def fault(self) -> int:
        """Present fault number, 0 for none."""
    load: float
    """Load torque as a share of the motor's rated torque: 0.0..=4.0."""
    inputs: int
    """Digital inputs, bit 0 = S1."""
    def trip(self, code: int, /) -> None:
        """Trips the drive with fault *code*."""
    def refuse(
        self,
        code: int,
        /,
        *,
        asked: str = "anything",
        share: float = 1.0,
        seconds: float | None = None,
        count: int | None = None,
        taken: bool = False,
    ) -> None:
        """Lets the drive refuse by exception *code* (1..=255); *asked* is `"anything"`, `"reads"` or `"writes"`."""
    def limit(self, address: int, highest: int, /) -> None:
        """Lets the drive take no more than *highest* by 06H at *address*, and say so in its answer."""
    def refuse_no_more(self) -> None:
        """The drive refuses only what its family refuses."""
    def power_cycle(self) -> None:
        """Switches the drive off and on: RAM is lost, EEPROM stays."""
    def factory_reset(self) -> None:
        """Gives every parameter its factory value. NotAllowed while the motor is fed."""
    def register(self, address: int, /) -> int:
        """The word at *address* as the drive would answer it now. NotAllowed where it would refuse."""
    @property
    def eeprom_writes(self) -> int: ...
    def eeprom_writes_of(self, address: int, /) -> int: ...
    def writes(self) -> list[tuple[float, int, int]]:
        """Every word the drive took from the bus: seconds, address, value. The last 100 000."""
    def take_writes(self) -> list[tuple[float, int, int]]:
        """As `writes`, and forgets them."""
    @property
    def words_written(self) -> int:
        """How many words the drive has taken from the bus, ever."""

@final
class Sniffer:
    """Finds the frames of both directions on a line that others use, and says of each who said it.

    Pieces are `(role, data, began, ended, gap, kept, turnaround, error)`, in the order of the wire; each byte comes
    out once. `role` is `"request"`, `"answer"` (to the request before it), `"late"`, `"doubtful"`, `"stray"` or
    `"noise"`, which alone has an error: why it is not a frame. `kept` is how long the adapter kept it back at least.
    Moments are those given, times are seconds.
    """

    def __new__(cls, format: SerialFormat) -> Sniffer: ...  # noqa: A002
    def receive(self, at: float, data: Buffer) -> list[_Piece]:
        """Takes bytes that were handed over at *at*; returns what was heard by then."""
    def poll(self, at: float) -> list[_Piece]:
        """What was heard by *at*, although nothing came."""
    def finish(self) -> list[_Piece]:
        """The rest: nothing more will come."""

@final
class SimulatedLine:
    """The simulated wire: what was on it, and how it spoils answers."""

    format: SerialFormat
    """The settings of all units on the line. May be set, as at their keypads; what is on its way is then lost.

    Ports stay as they are: a pseudo-terminal has the speed that a program set, a TCP port the settings that the
    simulation began with. Units do not understand what comes with other settings than theirs. A bus in this process
    always fits.
    """
    @property
    def requests(self) -> int: ...
    @property
    def silence_violations(self) -> int:
        """Requests that began before the silence was over."""
    def answer_with(self, data: Buffer, /) -> None:
        """The next answer on the line is *data* instead, as it is."""
    def drop_answers(self, count: int = 1, /) -> None: ...
    def delay_answers(self, seconds: float, count: int = 1, /) -> None: ...
    def noise_before(self, data: Buffer, count: int = 1, /) -> None: ...
    def noise_after(self, data: Buffer, count: int = 1, /) -> None: ...
    def clear(self) -> None:
        """Forgets every fault: those that wait, the rates and the script. An adapter that echoes goes on echoing."""
    def set_faults(self, **rates: float) -> None:
        """Sets the share (0.0..1.0) of answers that each kind of fault hits; kinds that are not named have none.

        `all` is every kind but `unplug`. docs/simulator.md says what each does.
        """
    @property
    def faults(self) -> dict[str, float]:
        """The kinds that have a rate, and the rate."""
    def script(self, faults: Iterable[tuple[int, str | bytes]], /) -> None:
        """Says which answer, counted from now (the next one is 1), is hit by what kind, or which bytes come instead.

        Rates go on beside it. NotAllowed: something else stands in the list; nothing was changed.
        """
    def fault_counts(self) -> dict[str, int]:
        """How often each kind has happened."""
    def set_times(
        self,
        *,
        delay: float | None = None,
        late: float | None = None,
        overtaken: tuple[float, float] | None = None,
        replug: float | None = None,
    ) -> None:
        """Sets how long faults take, in seconds.

        *delay* at most (0.05), *late* at least and twice that at most (0.6), *overtaken* at least and at most (0.6 and
        2.4), *replug* until an adapter that fell out by rate is back (0.5). NotAllowed where the least is more than
        the most.
        """
    echo: bool
    """Whether the adapter hands back what it sends."""
    def unplug(self) -> None:
        """Pulls the adapter out: the port is gone, and what it was sending is cut off."""
    def replug(self) -> None:
        """Puts it back. A pseudo-terminal then has another name. PortError where the system has no port to give."""
    @property
    def plugged(self) -> bool: ...
    def trace(self) -> list[tuple[float, str, bytes]]:
        """The last 1000 transmissions: seconds of their first bit, `"master"` or `"unit"`, bytes."""
