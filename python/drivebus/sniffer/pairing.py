"""Makes exchanges of what the core has told apart: each request with what came of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import TypedDict

from drivebus._native import SerialFormat, Sniffer, exception_means, judge, misses
from drivebus.capture import Captured, answers
from drivebus.checks import UNITS, counted
from drivebus.errors import BadAnswer, CrcError, DrivebusError, NoAnswer, Refused
from drivebus.line.inside import wrong_inside
from drivebus.profile import Profile
from drivebus.rtu import framed
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.families import Families
from drivebus.sniffer.foreign import Foreign

__all__ = ["Pairing", "exchanges_in"]

_Piece = tuple[str, bytes, float, float, "float | None", float, "float | None", "str | None"]

_GIVEN_UP = 5.0
"""Seconds after which a request is told as unanswered, although nothing was asked since."""


class _Facts(TypedDict):
    """What an error tells of the request."""

    unit: int
    request: bytes
    started: float


class Pairing:
    """Hears a line and tells its exchanges.

    Args:
        line: How characters look on it.
        families: Which family each unit is of.
        ahead: Seconds that Unix time is ahead of the moments that are given.
    """

    def __init__(self, line: SerialFormat, families: Families, ahead: float = 0.0) -> None:
        self._sniffer = Sniffer(line)
        self._families = families
        self._ahead = ahead
        self._open: _Piece | None = None
        self._noise: list[_Piece] = []
        self._doubt = b""
        self._unanswered: bytes = b""
        self._repeated = 0
        self._lump = 0.0
        self._foreign = Foreign(families, ahead)

    def receive(self, at: float, data: bytes) -> Iterator[Exchange]:
        """Takes *data*, handed over at *at* on the line's clock; yields what is decided by then."""
        yield from self._told(self._sniffer.receive(at, data) if data else self._sniffer.poll(at))
        if self._open is not None and at - self._open[3] > _GIVEN_UP:
            yield self._unheard(self._open)
        yield from self._foreign.settle(at - _GIVEN_UP)

    def take(self, pieces: Iterable[_Piece]) -> Iterator[Exchange]:
        """The exchanges in *pieces* that were told apart elsewhere."""
        yield from self._told(pieces)
        if self._open is not None:
            yield self._unheard(self._open, is_last=True)
        yield from self._foreign.settle()

    def finish(self) -> Iterator[Exchange]:
        """The rest: nothing more will come."""
        yield from self._told(self._sniffer.finish())
        if self._open is not None:
            yield self._unheard(self._open, is_last=True)
        yield from self._foreign.settle()

    def _told(self, pieces: Iterable[_Piece]) -> Iterator[Exchange]:
        for piece in pieces:
            role, data, *_ = piece
            if role != "noise":
                self._lump = max(self._lump, piece[5])
            before = self._open
            if self._foreign.takes(piece):
                if before is not None and self._foreign.has(before):
                    # What was taken for a request of Modbus.
                    self._open = None
                    yield from self._foreign.hear(before, self._lump)
                yield from self._foreign.hear(piece, self._lump)
                continue
            if role in ("request", "asked"):
                if self._open is not None:
                    yield self._unheard(self._open)
                self._open = piece
                if data[0] == 0 and role == "request":
                    yield self._ended(piece, None, None)
            elif role == "answer" and self._open is not None:
                yield from map(self._beside, self._noise)
                yield self._ended(self._open, piece, self._refusal(self._open[1], data))
            elif (wrong := self._wrong_inside(piece)) is not None:
                yield from self._miscounted(piece, wrong)
            elif role == "noise" and self._open is not None:
                self._noise.append(piece)
            elif role == "doubtful" and self._open is not None:
                self._doubt += data
            else:
                yield self._beside(piece)

    def _ended(self, asked: _Piece, answer: _Piece | None, error: DrivebusError | None) -> Exchange:
        request = asked[1]
        came = None if answer is None else answer[1]
        self._families.hear(request, came)
        profile = self._families.of(request[0], request)
        repeated = self._repeated if request == self._unanswered else 0
        self._unanswered, self._repeated = (b"", 0) if error is None or came is not None else (request, repeated + 1)
        self._open, self._noise, self._doubt = None, [], b""
        return Exchange(
            unit=request[0],
            request=request,
            answer=came,
            time=asked[2] + self._ahead,
            gap=asked[4],
            turnaround=None if answer is None else answer[6],
            error=error,
            answered=None if answer is None else answer[3] + self._ahead,
            values=self._families.values(request, came),
            profile=None if profile is None else profile.name,
            repeated=repeated,
            lump=self._lump,
        )

    def _unheard(self, asked: _Piece, is_last: bool = False) -> Exchange:
        """The exchange of a request that nobody has surely answered; *is_last* if nothing at all came behind it."""
        request = asked[1]
        who = f"unit {request[0]}"
        facts = self._facts(asked)
        if self._doubt:
            text = f"{who} may have answered, or was asked once more: what was heard does not tell"
            return self._ended(asked, None, BadAnswer(text, raw=self._doubt, **facts))
        if self._noise:
            noise = b"".join(piece[1] for piece in self._noise)
            text = f"{who} was answered by {counted(len(noise), 'byte')} and no frame"
            return self._ended(asked, None, BadAnswer(text, raw=noise, **facts))
        until = " before the end" if is_last else ""
        return self._ended(asked, None, NoAnswer(f"{who} did not answer{until}", **facts))

    def _miscounted(self, piece: _Piece, wrong: str) -> Iterator[Exchange]:
        """The exchanges that end with *piece*, a frame whose CRC is right and whose inside is *wrong*."""
        data, asked = piece[1], self._open
        if asked is not None and misses(asked[1], data) is not None:
            yield self._ended(asked, None, BadAnswer(wrong, raw=data, **self._facts(asked)))
            return
        if asked is not None and judge(data)[0]:
            yield self._unheard(asked)
        yield self._beside(piece, wrong)

    def _wrong_inside(self, piece: _Piece) -> str | None:
        """What is wrong inside of *piece*, where it is one that was told to be no answer for that."""
        role, data, *_ = piece
        if role not in ("missed", "noise"):
            return None
        return wrong_inside(data, None if self._open is None else self._open[1])

    def _facts(self, asked: _Piece) -> _Facts:
        return _Facts(unit=asked[1][0], request=asked[1], started=asked[2] + self._ahead)

    def _refusal(self, request: bytes, answer: bytes) -> Refused | None:
        if answer[1] & 0x80 == 0:
            return None
        unit, code = answer[0], answer[2]
        profile: Profile | None = self._families.of(unit)
        name, meaning = ("", "") if profile is None else profile.exception(code)
        means = exception_means(code) if profile is None else profile.exception_means(code)
        known = f" ({name}: {meaning})" if name else ""
        text = f"unit {unit} refused function {request[1]:02X}H with exception {code:02X}H{known}"
        return Refused(text, code=code, name=name, meaning=meaning, means=means, unit=unit, request=request, raw=answer)

    def _beside(self, piece: _Piece, inside: str = "") -> Exchange:
        """What belongs to no request that is open; *inside* says what is wrong inside of it."""
        role, data, began, ended, gap, _, _, why = piece
        if inside:
            miscounted = BadAnswer(inside, unit=data[0], raw=data)
            return Exchange(data[0], None, None, began + self._ahead, gap, None, miscounted, lump=self._lump)
        if role == "noise":
            kind = CrcError if len(data) >= 4 else BadAnswer
            because = (why or "").rpartition(" are not a frame: ")[2]
            text = f"{counted(len(data), 'byte')} {'is' if len(data) == 1 else 'are'} not a frame: {because}"
            return Exchange(None, None, None, began + self._ahead, gap, None, kind(text, raw=data), lump=self._lump)
        texts = {
            "late": f"unit {data[0]} answered late, when something else had been asked",
            "doubtful": f"unit {data[0]} answered late, or was asked once more: what was heard does not tell",
        }
        text = texts.get(role, f"unit {data[0]} answered something that was not asked of it")
        wrong = BadAnswer(text, unit=data[0], raw=data)
        return Exchange(
            data[0], None, data, began + self._ahead, gap, None, wrong, ended + self._ahead, lump=self._lump
        )


def exchanges_in(
    frames: Iterable[Captured], line: SerialFormat, families: Families | None = None
) -> Iterator[Exchange]:
    """The exchanges in the *frames* of a capture.

    Where the capture tells who sent each, that is believed; otherwise it is worked out, as of a line that is heard.
    Frames without a time are taken to follow each other. A request is answered on its own line and connection: where
    there are several, the exchanges of each follow those of the one before.
    """
    told = Families() if families is None else families
    talks: dict[tuple[str, int], list[Captured]] = {}
    for frame in frames:
        talks.setdefault((frame.line, frame.connection), []).append(frame)
    for talk in talks.values():
        yield from _exchanges_of(talk, line, told)


def _exchanges_of(known: list[Captured], line: SerialFormat, families: Families) -> Iterator[Exchange]:
    """The exchanges of one line."""
    pairing = Pairing(line, families)
    if known and all(frame.asks is not None or not frame.is_frame for frame in known):
        yield from pairing.take(_pieces(known, line))
        return
    # Moments near to zero: a float has no room for nanoseconds since 1970.
    began = next((frame.time for frame in known if frame.time is not None), 0.0)
    for index, frame in enumerate(known):
        at = _BETWEEN * index if frame.time is None else frame.time - began
        for exchange in pairing.receive(at + 1.0, frame.data):
            yield _later(exchange, began - 1.0)
    for exchange in pairing.finish():
        yield _later(exchange, began - 1.0)


_BETWEEN = 0.01
"""Seconds between frames that have no time."""


def _later(exchange: Exchange, by: float) -> Exchange:
    answered = None if exchange.answered is None else exchange.answered + by
    return replace(exchange, time=exchange.time + by, answered=answered)


def _pieces(frames: Sequence[Captured], line: SerialFormat) -> Iterator[_Piece]:
    """What the core would have told of *frames*, of which it is known who sent them."""
    open_, asked = b"", 0.0
    last: float | None = None
    for frame, following in zip_longest(frames, frames[1:]):
        ended = (last or 0.0) if frame.time is None else frame.time
        began = ended if frame.at_once else ended - len(frame.data) * line.char_time
        gap = None if last is None else max(began - last, 0.0)
        last = ended
        if not frame.is_frame:
            yield "noise", frame.data, began, ended, gap, 0.0, None, _why_not(frame.data)
        elif wrong_inside(frame.data) is not None:
            yield "noise", frame.data, began, ended, gap, 0.0, None, None
        elif frame.asks:
            open_, asked = frame.data, ended
            # Unit 0 is everybody on a serial line, and answers behind a gateway of Modbus TCP.
            is_answered = frame.data[0] == 0 and following is not None and _answers(open_, following)
            yield "asked" if is_answered else "request", frame.data, began, ended, gap, 0.0, None, None
        elif open_ and _answers(open_, frame):
            open_ = b""
            yield "answer", frame.data, began, ended, gap, 0.0, max(began - asked, 0.0), None
        elif open_ and misses(open_, frame.data) is not None:
            open_ = b""
            yield "missed", frame.data, began, ended, gap, 0.0, None, None
        else:
            yield "stray", frame.data, began, ended, gap, 0.0, None, None


def _answers(request: bytes, answer: Captured) -> bool:
    if answer.asks:
        return False
    # A gateway of Modbus TCP has units that a serial line has not, which answer as any; so do those that the
    # specification reserves, where a line has them.
    is_reserved = request[0] > UNITS[-1] and request[0] == answer.data[0]
    if answer.at_once or is_reserved:
        return answers(*map(_of_a_line, (request, answer.data)))
    return answers(request, answer.data)


def _of_a_line(frame: bytes) -> bytes:
    """*frame* as if it were of a unit that a serial line can have."""
    if frame[0] in UNITS:
        return frame
    return framed(bytes([1]) + frame[1:-2])


def _why_not(data: bytes) -> str | None:
    """Why *data* is not a frame; None of one."""
    try:
        judge(data)
    except DrivebusError as error:
        return str(error)
    return None
