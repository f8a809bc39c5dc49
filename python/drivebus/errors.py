"""Every error this package raises, sorted by whose fault it is.

After an error on a line with a motor at its end, the first question is: *did the drive take it?* Each class answers
that in its docstring. Nothing that arrives on a line can raise anything outside this tree.

The compiled core imports this module and raises these classes.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from errno import EIO
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict

from drivebus.advice import Advice, Text

__all__ = [
    "LINE_ERRORS",
    "BadAnswer",
    "BadArgument",
    "BadLink",
    "CrcError",
    "DrivebusError",
    "DrivebusWarning",
    "NoAnswer",
    "NotAllowed",
    "NotReached",
    "NotReady",
    "NotStopped",
    "PortError",
    "QueueFull",
    "Refused",
    "SharedCodeWarning",
    "StoreWarning",
    "Unconfirmed",
    "Unverified",
    "WrongDrive",
]


if TYPE_CHECKING:
    from typing_extensions import Unpack


class Details(TypedDict, total=False):
    """What every error may have beside its message: see `DrivebusError`."""

    unit: int | None
    request: bytes
    raw: bytes
    started: float | None
    ended: float | None


_READS = (b"\x01", b"\x02", b"\x03", b"\x04", b"\x11", b"\x2b\x0e")


class DrivebusError(Exception):
    """The base of all errors here.

    Attributes:
        unit: The unit that was asked (1..247, 0 for a broadcast), or None where no unit is concerned.
        request: The whole request frame, sent or not; empty if none was made.
        raw: The bytes that came back, as they came; empty if none did.
        started: Unix time in seconds at which the request began; None if it was not sent, or where several were.
        ended: Unix time in seconds at which it was given up or answered, or None.
        in_part: Whether the drive took other writes of the same call before this one went wrong: some of several
            parameters, or words that come before a start.
    """

    unit: int | None
    request: bytes
    raw: bytes
    started: float | None
    ended: float | None
    in_part: bool = False

    def __init__(
        self,
        message: str = "",
        *,
        unit: int | None = None,
        request: bytes = b"",
        raw: bytes = b"",
        started: float | None = None,
        ended: float | None = None,
    ) -> None:
        super().__init__(message)
        self.unit = unit
        self.request = bytes(request)
        self.raw = bytes(raw)
        self.started = started
        self.ended = ended

    def __reduce__(self) -> tuple[Any, ...]:
        # The built-in reduction passes positional arguments only, and OSError adds its own.
        return _rebuild, (type(self), self.text, dict(self.__dict__))

    @property
    def may_have_taken(self) -> bool:
        """Whether a drive may have taken what was asked of it, or a part. False: it surely has not; ask again."""
        return self.in_part or self._may_have_taken_it()

    def _may_have_taken_it(self) -> bool:
        """The same of the request that failed, whatever came before it."""
        if not isinstance(self, LINE_ERRORS):
            return True
        # Of one request it is known whether it was sent, and a read asks for nothing.
        if not self.request:
            return self.unit is not None
        return self.started is not None and not self.request.startswith(_READS, 1)

    @property
    def text(self) -> Text:
        """The message, with the calls and arguments that it names as data: each face has its own words for them."""
        return Text(*self.args[:1])

    @property
    def advice(self) -> tuple[Advice, ...]:
        """The calls and arguments that the message names: what helps, or what else may be done."""
        return tuple(part for part in self.text.parts if isinstance(part, Advice))


class PortError(DrivebusError, OSError):
    """The port is missing, busy, not permitted, or lost. The next call opens it again.

    Did the drive take it? If the port was lost after the request had left, it may have.

    Attributes:
        errno: Which of these, as the system's errors have it. ENOENT: there is no such port. EBUSY: another program has
            it. EACCES: this user may not open it. ENODEV: it was open and is gone. EBADF: it is closed, or not open
            yet. EINVAL: it cannot do what was asked of it. EIO: anything else.
    """

    def __init__(self, message: str = "", *, errno: int | None = EIO, **details: Unpack[Details]) -> None:
        super().__init__(message, **details)
        self.errno = errno

    def __reduce__(self) -> tuple[Any, ...]:
        rebuild, (kind, message, state) = super().__reduce__()
        # It stands beside the other attributes, not among them.
        return rebuild, (kind, message, {**state, "errno": self.errno})


class NoAnswer(DrivebusError, TimeoutError):
    """The unit stayed silent.

    Did the drive take it? It may have: a silent drive has either not heard the request, or its answer was lost.
    """


class BadAnswer(DrivebusError):
    """Bytes came, but not a valid answer to the request. They are in `raw`.

    Did the drive take it? It may have: only its answer is known to be bad.
    """


class CrcError(BadAnswer):
    """The bytes that came do not match their own CRC; the message names both values.

    Did the drive take it? It may have: only its answer is known to be damaged.
    """


Decision: TypeAlias = Literal["no_such", "not_now", "ask_again", "taken"]
"""What a unit decides by an exception; see `Refused`."""

Why: TypeAlias = Literal[
    "",
    "fault",
    "no_voltage",
    "unknown_state",
    "turning",
    "control_source",
    "settings",
    "read_only",
    "being_stopped",
    "halted",
    "ending",
]
"""What stands against what was asked; see `NotReady`. Empty where nobody said."""


class Refused(DrivebusError):
    """The drive refused: an exception answer.

    Did the drive take it? No: what it was doing before, it still does. Only where *means* is `"taken"` it did, and is
    at it. Where *in_part* is true it took others of the same call before.

    Attributes:
        code: The exception code, 1..255.
        name: Its short name, such as `"illegal_address"`.
        meaning: What this family of drives means by it; empty from a `Bus`, which knows no family.
        means: Whether that is a decision. `"no_such"`: there is no such function, address or value. `"not_now"`: it is
            not allowed now, which another state of the drive may change. `"ask_again"`: the drive is busy, or the
            request reached it damaged; it was asked again as often as the bus may. `"taken"`: the drive took it and is
            still at it. From a `Bus` as the Modbus specification has the code.
    """

    code: int
    name: str
    meaning: str
    means: Decision

    def __init__(
        self,
        message: str = "",
        *,
        code: int = 0,
        name: str = "",
        meaning: str = "",
        means: Decision = "not_now",
        **details: Unpack[Details],
    ) -> None:
        super().__init__(message, **details)
        self.code = code
        self.name = name
        self.meaning = meaning
        self.means = means

    def _may_have_taken_it(self) -> bool:
        return self.means == "taken"

    @property
    def is_decision(self) -> bool:
        """Whether the drive has decided that it does not do it: *means* is `"no_such"` or `"not_now"`."""
        return self.means in ("no_such", "not_now")


class Unconfirmed(DrivebusError):
    """A command was sent, and its effect is not known or did not show in time.

    Did the drive take it? Nobody knows from here. The message names the state that was seen last. Commands are never
    repeated by this package: look at the machine, then decide.
    """


class NotReached(Unconfirmed, TimeoutError):
    """A drive was waited for, and the time was up: its speed, or its standstill, was not seen.

    Did the drive take it? Nothing was sent but reads. It goes on as it was; the message names the state that was seen
    last.
    """

    def _may_have_taken_it(self) -> bool:
        return False


class NotStopped(Unconfirmed):
    """Several drives were told to stop, and some of them were not proved to: `Bus.stop_all`.

    Did the drives take it? The error of each says that. The others were stopped.

    Attributes:
        failures: The error of each unit that was not proved to stop, by its address.
    """

    failures: dict[int, DrivebusError]

    def __init__(
        self, message: str = "", *, failures: Mapping[int, DrivebusError] | None = None, **details: Unpack[Details]
    ):
        super().__init__(message, **details)
        self.failures = dict(failures or {})


class NotAllowed(DrivebusError, ValueError):
    """What was asked is not done. Most are one of the kinds below, which a program can tell apart.

    Did the drive take it? No: what was asked was not sent. Where *in_part* is true, what comes before it was.
    """

    def _may_have_taken_it(self) -> bool:
        return False


class BadArgument(NotAllowed):
    """What was given cannot be: an unknown name, out of range, of another type, a file that is not what it should be.

    Did the drive take it? No: what was asked was not sent. The same call is refused the next time, too.
    """


class NotReady(NotAllowed):
    """What was asked is right, and has to wait for another state: of the drive, the bus or the program.

    Did the drive take it? No: what was asked was not sent.

    Attributes:
        why: What stands against it. `"fault"`: the drive is in fault. `"no_voltage"`: its DC bus has none.
            `"unknown_state"`: its state word is none that its family has. `"turning"`: its motor turns.
            `"control_source"`: its commands come from elsewhere. `"settings"`: a
            parameter must be set, which the message names. `"read_only"`: the bus is for reading only.
            `"being_stopped"`: the drive is being stopped for a program that is gone. `"halted"`: somebody told it to
            stop meanwhile. `"ending"`: the program ends.
    """

    why: Why

    def __init__(self, message: str = "", *, why: Why = "", **details: Unpack[Details]) -> None:
        super().__init__(message, **details)
        self.why = why


class BadLink(NotAllowed):
    """So much is lost on the line that a motor is not started: its stop might be lost as well.

    Did the drive take it? No: what was asked was not sent.
    """


class Unverified(NotAllowed):
    """No document of the family proves what is needed for it. Where `unverified=True` helps, the message says so.

    Did the drive take it? No: what was asked was not sent.
    """


class WrongDrive(NotAllowed):
    """Another drive than you mean is at the address, or may be; or a file is of another drive.

    Did the drive take it? No: what was asked was not sent.
    """


class QueueFull(NotAllowed):
    """As many requests wait for the line as may.

    Did the drive take it? No: what was asked was not sent. A stop is never refused so.
    """


LINE_ERRORS = (NoAnswer, BadAnswer, PortError)
"""What a line can do to any request: of one that left, nothing is known."""


class DrivebusWarning(UserWarning):
    """The base of all warnings here."""


class StoreWarning(DrivebusWarning):
    """The same parameter is stored in EEPROM again and again; its write life is limited. Write to RAM instead."""


class SharedCodeWarning(DrivebusWarning):
    """Several families report this code, and the only one with a profile is used. Name the family by `profile`."""


def level_of_the_program() -> int:
    """Where the program stands above the caller, for `warnings.warn`: how deep depends on who carries the work out."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == "drivebus":
        level, frame = level + 1, frame.f_back
    return level


def _rebuild(cls: type[DrivebusError], message: str, state: dict[str, Any]) -> DrivebusError:
    error = cls(message)
    for name, value in state.items():
        setattr(error, name, value)
    return error
