"""Two buses that tell the same story: one notes what an operation asks of a line, the other one gives it back.

`Noting` passes each wish on to a real bus in virtual time, and notes it with its outcome and how long it took.
`Replaying` has no line: it compares each wish with the one that was noted, and gives the outcome that was noted. Both
hand out what stands in a step, and nothing else, so that an operation cannot tell them apart.

A step is a list: the wish as text, the outcome as JSON has it, how many microseconds passed, and where it changed what
is seen of the line then. tests/vectors/README.md has the form.
"""

from __future__ import annotations

import struct
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, TypeAlias, overload

from drivebus import errors
from drivebus.errors import LINE_ERRORS, DrivebusError, NotReady, PortError, Refused, Unconfirmed
from drivebus.line.asking import Read, Stamped, Write
from drivebus.line.stats import Link
from drivebus.rtu import encode_write, framed

__all__ = ["EPOCH", "UNIT", "Noting", "Replaying", "Step", "Telling", "rebuilt", "told_of", "wish_of"]

UNIT = 1
"""The unit of each conversation."""

EPOCH = 1000.0
"""Seconds of Unix time at which each conversation begins: the clock on the wall is not the same twice."""

Step: TypeAlias = list[Any]

_READS = {"coil": 0x01, "discrete": 0x02, "holding": 0x03, "input": 0x04}

_SENT = (*LINE_ERRORS, Refused, Unconfirmed)
"""Errors of a request that most likely was sent."""

_NOTHING = ""
"""The outcome of a write that was confirmed, and of a wait."""

_Send = Callable[[], Awaitable[Any]]


class Line:
    """What stands for a line of which nothing is known yet."""


class Telling:
    """A bus whose answers are those of steps: what both have in common.

    Attributes:
        reconnects: See `AwaitableBus`.
        closed: See `AwaitableBus`.
        line: See `AwaitableBus`.
    """

    def __init__(self) -> None:
        self.reconnects = 0
        self.closed = False
        self.line: object = Line()
        self._microseconds = 0

    def now(self) -> float:
        """Seconds since the conversation began, by its steps."""
        return self._microseconds / 1e6

    async def sleep(self, seconds: float, /) -> None:
        """See `AwaitableBus`."""
        await self._outcome(f"sleep {seconds!r}", lambda: self._sleep(seconds))

    @overload
    async def ask(self, request: Read, /) -> list[int]: ...
    @overload
    async def ask(self, request: Write, /) -> None: ...
    async def ask(self, request: Read | Write, /) -> list[int] | None:
        """See `AwaitableBus`."""
        if isinstance(request, Read):
            return _words(await self._outcome(wish_of(request), lambda: self._ask(request), request))
        await self._outcome(wish_of(request), lambda: self._ask(request), request)
        return None

    async def ask_stamped(self, request: Read, /) -> Stamped:
        """As `AwaitableBus`; the moments are those of the line's clock, from `EPOCH` on."""
        asked = EPOCH + self.now()
        wish = wish_of(request, stamped=True)
        words = await self._outcome(wish, lambda: self._ask(request, stamped=True), request)
        return Stamped(_words(words), asked, EPOCH + self.now())

    async def link(self, unit: int, /) -> Link:
        """See `AwaitableBus`."""
        good, asked = await self._outcome(f"link{_at(unit)}", lambda: self._link(unit))
        return Link(good, asked)

    async def halts(self, unit: int, /) -> int | None:
        """See `AwaitsHalts`."""
        number: int | None = await self._outcome(f"halts{_at(unit)}", lambda: self._halts(unit))
        return number

    def undisturbed(self) -> AbstractContextManager[Telling]:
        """Itself: nothing here is given up."""
        return nullcontext(self)

    def blocking(self) -> Telling:
        """Itself."""
        return self

    async def _outcome(self, wish: str, send: _Send, request: Read | Write | None = None) -> Any:
        """The outcome of *wish*, as it stands in its step. Raises the error that stands there."""
        began = self.now()
        _, outcome, took, *seen = await self._step(wish, send)
        self._microseconds += took
        for changed in seen:
            self.reconnects = changed.get("reconnects", self.reconnects)
            self.closed = changed.get("closed", self.closed)
        if isinstance(outcome, dict):
            raise rebuilt(outcome, request, EPOCH + began, EPOCH + self.now())
        return outcome

    async def _step(self, wish: str, send: _Send, /) -> Step:
        raise NotImplementedError

    async def _sleep(self, seconds: float) -> str:
        raise NotImplementedError

    async def _ask(self, request: Read | Write, *, stamped: bool = False) -> str:
        raise NotImplementedError

    async def _link(self, unit: int) -> list[int]:
        raise NotImplementedError

    async def _halts(self, unit: int) -> int | None:
        raise NotImplementedError


class Noting(Telling):
    """A bus that passes each wish on to *bus*, and notes it.

    Args:
        bus: What blocks, as operations await it.
        clock: The seconds of its clock.
        before: Is told of each request before it goes out, and gives what goes out in its place.
        after: Is told of a read and of the words that came, and gives those that are taken for its answer.

    Attributes:
        steps: What was noted since `begin`.
    """

    def __init__(
        self,
        bus: Any,
        clock: Callable[[], float],
        before: Callable[[Read | Write], Read | Write],
        after: Callable[[Read, Sequence[int]], Sequence[int]],
    ) -> None:
        super().__init__()
        self.steps: list[Step] = []
        self._bus, self._clock, self._before, self._after = bus, clock, before, after
        self._began = clock()
        self._first_halts: int | None = None

    def begin(self) -> list[Step]:
        """From here on it is noted for another call: in the list that this returns."""
        self.steps = []
        return self.steps

    async def _step(self, wish: str, send: _Send, /) -> Step:
        began = self._now()
        # Otherwise what an operation does would depend on more than its steps say.
        assert began == self._microseconds, "time passed between two wishes"
        outcome: Any
        try:
            outcome = await send()
        except DrivebusError as error:
            outcome = told_of(error)
        step: Step = [wish, outcome, self._now() - began]
        seen: dict[str, int | bool] = {}
        if self._bus.reconnects != self.reconnects:
            seen["reconnects"] = self._bus.reconnects
        if self._bus.closed != self.closed:
            seen["closed"] = self._bus.closed
        if seen:
            step.append(seen)
        self.steps.append(step)
        return step

    def _now(self) -> int:
        return round((self._clock() - self._began) * 1e6)

    async def _sleep(self, seconds: float) -> str:
        await self._bus.sleep(seconds)
        return _NOTHING

    async def _ask(self, request: Read | Write, *, stamped: bool = False) -> str:
        sent = self._before(request)
        if isinstance(request, Read):
            words = (await self._bus.ask_stamped(sent)).words if stamped else await self._bus.ask(sent)
            return "".join(f"{word:04X}" for word in self._after(request, words))
        if isinstance(sent, Write) and sent.halts is not None:
            sent = sent._replace(halts=sent.halts + (self._first_halts or 0))
        await self._bus.ask(sent)
        return _NOTHING

    async def _link(self, unit: int) -> list[int]:
        link = await self._bus.link(unit)
        return [link.good, link.asked]

    async def _halts(self, unit: int) -> int | None:
        number: int | None = await self._bus.halts(unit)
        if number is None:
            return None
        # A line counts from a number by chance.
        self._first_halts = number if self._first_halts is None else self._first_halts
        return number - self._first_halts


class Replaying(Telling):
    """A bus without a line, which knows what will be asked and what was answered.

    Attributes:
        wrong: What was asked and stands in no step, in words; empty where nothing was.
    """

    def __init__(self) -> None:
        super().__init__()
        self.wrong = ""
        self._steps: Sequence[Step] = ()
        self._place = 0

    def begin(self, steps: Sequence[Step]) -> None:
        """From here on *steps* are what comes."""
        self._steps, self._place = steps, 0

    def finish(self) -> None:
        """Makes sure that all that was noted was asked, and nothing else."""
        assert not self.wrong, self.wrong
        left = self._steps[self._place :]
        assert not left, f"{len(left)} wishes are not made, first: {left[0][0]}"

    async def _step(self, wish: str, _send: _Send, /) -> Step:
        if self._place == len(self._steps):
            self._differs(f"beyond the last step: {wish}")
        step = self._steps[self._place]
        if step[0] != wish:
            self._differs(f"step {self._place} was {step[0]!r}, and is {wish!r}")
        self._place += 1
        return step

    def _differs(self, how: str) -> None:
        """Fails, and keeps the reason: an operation that cleans up after any error may hide it."""
        self.wrong = self.wrong or f"{how}, {self.now():.6f} s after the beginning"
        raise AssertionError(self.wrong)


def wish_of(request: Read | Write, *, stamped: bool = False) -> str:
    """*request* as a step has it: all of it, what is as usual left out."""
    place = f"{_at(request.unit)} {'' if request.table == 'holding' else f'{request.table}:'}{request.address:04X}"
    if isinstance(request, Read):
        text = f"{'stamped' if stamped else 'read'}{place} {request.count}"
        text += " verify" if request.verify else ""
        numbers: dict[str, float | None] = {"timeout": request.timeout, "retries": request.retries}
    else:
        several = not isinstance(request.value, int)
        words = [request.value] if isinstance(request.value, int) else request.value
        text = " ".join(f"{word:04X}" for word in words)
        text = f"write{place} {f'[{text}]' if several else text}"
        text += " force" if request.force else ""
        text += "" if request.read_back is None else f" read_back={request.read_back:04X}"
        numbers = {"connection": request.connection, "halts": request.halts, "timeout": request.timeout}
    text += " urgent" if request.urgent else ""
    return text + "".join(f" {name}={number!r}" for name, number in numbers.items() if number is not None)


_SPECIFIED = {
    1: ("illegal_function", "no_such"),
    2: ("illegal_data_address", "no_such"),
    3: ("illegal_data_value", "no_such"),
    4: ("server_device_failure", "not_now"),
    6: ("server_device_busy", "ask_again"),
}
"""What exceptions are called, and mean, where no more is noted: *Modbus Application Protocol* V1.1b3, section 7."""


def told_of(error: DrivebusError) -> dict[str, Any]:
    """*error* as a step has it: its class, and what an operation looks at."""
    told: dict[str, Any] = {"error": type(error).__name__}
    if isinstance(error, Refused):
        told["code"] = error.code
        is_usual = _SPECIFIED.get(error.code) == (error.name, error.means)
        return told if is_usual else told | {"name": error.name, "means": error.means}
    if isinstance(error, _SENT):
        told |= {} if error.started is not None else {"unsent": True}
        told |= {"raw": error.raw.hex().upper()} if error.raw else {}
    if isinstance(error, NotReady):
        told["why"] = error.why
    if isinstance(error, PortError):
        told["errno"] = error.errno
    return told


def rebuilt(told: dict[str, Any], request: Read | Write | None, started: float, ended: float) -> DrivebusError:
    """The error that *told* tells of, of a *request* that began at *started* where it was sent."""
    how: dict[str, Any] = {name: told[name] for name in ("code", "name", "means", "why", "errno") if name in told}
    kind: type[DrivebusError] = getattr(errors, told["error"])
    if issubclass(kind, Refused) and "name" not in told:
        how["name"], how["means"] = _SPECIFIED[told["code"]]
    if issubclass(kind, _SENT):
        how |= {"raw": bytes.fromhex(told.get("raw", "")), "ended": ended}
        how |= {} if request is None else {"request": frame_of(request)}
        how |= {} if "unsent" in told else {"started": started}
    return kind("as it was noted", unit=UNIT, **how)


def frame_of(request: Read | Write) -> bytes:
    """The frame of *request*, as the specification has it."""
    if isinstance(request, Read):
        return framed(struct.pack(">BBHH", request.unit, _READS[request.table], request.address, request.count))
    if request.table == "coil":
        return framed(struct.pack(">BBHH", request.unit, 0x05, request.address, 0xFF00 if request.value else 0))
    return encode_write(request.unit, request.address, request.value)


def _at(unit: int) -> str:
    return "" if unit == UNIT else f" unit={unit}"


def _words(outcome: str) -> list[int]:
    return [int(outcome[place : place + 4], 16) for place in range(0, len(outcome), 4)]
