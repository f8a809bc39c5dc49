"""Makes exchanges of what the core has told apart: each request with what came of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypedDict

from drivebus._native import SerialFormat, Sniffer
from drivebus.errors import BadAnswer, CrcError, DrivebusError, NoAnswer, Refused
from drivebus.profile import Profile
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.families import Families

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
        self._noise = b""
        self._doubt = b""
        self._unanswered: bytes = b""
        self._repeated = 0
        self._lump = 0.0

    def receive(self, at: float, data: bytes) -> Iterator[Exchange]:
        """Takes *data*, handed over at *at* on the line's clock; yields what is decided by then."""
        yield from self._told(self._sniffer.receive(at, data) if data else self._sniffer.poll(at))
        if self._open is not None and at - self._open[3] > _GIVEN_UP:
            yield self._unheard(self._open)

    def finish(self) -> Iterator[Exchange]:
        """The rest: nothing more will come."""
        yield from self._told(self._sniffer.finish())
        if self._open is not None:
            yield self._unheard(self._open)

    def _told(self, pieces: Iterable[_Piece]) -> Iterator[Exchange]:
        for piece in pieces:
            role, data, *_ = piece
            if role != "noise":
                self._lump = max(self._lump, piece[5])
            if role == "request":
                if self._open is not None:
                    yield self._unheard(self._open)
                self._open = piece
                if data[0] == 0:
                    yield self._ended(piece, None, None)
            elif role == "answer" and self._open is not None:
                yield self._ended(self._open, piece, self._refusal(self._open[1], data))
            elif role == "noise" and self._open is not None:
                self._noise += data
            elif role == "doubtful" and self._open is not None:
                self._doubt += data
            else:
                yield self._beside(piece)

    def _ended(self, asked: _Piece, answer: _Piece | None, error: DrivebusError | None) -> Exchange:
        request = asked[1]
        came = None if answer is None else answer[1]
        self._families.hear(request, came)
        profile = self._families.of(request[0])
        repeated = self._repeated if request == self._unanswered else 0
        self._unanswered, self._repeated = (b"", 0) if error is None or came is not None else (request, repeated + 1)
        self._open, self._noise, self._doubt = None, b"", b""
        return Exchange(
            unit=request[0],
            request=request,
            answer=came,
            time=asked[2] + self._ahead,
            gap=asked[4],
            turnaround=None if answer is None else answer[6],
            error=error,
            values=self._families.values(request, came),
            profile=None if profile is None else profile.name,
            repeated=repeated,
            lump=self._lump,
        )

    def _unheard(self, asked: _Piece) -> Exchange:
        """The exchange of a request that nobody has surely answered."""
        request = asked[1]
        who = f"unit {request[0]}"
        facts = _Facts(unit=request[0], request=request, started=asked[2] + self._ahead)
        if self._doubt:
            text = f"{who} may have answered, or was asked once more: what was heard does not tell"
            return self._ended(asked, None, BadAnswer(text, raw=self._doubt, **facts))
        if self._noise:
            text = f"{who} was answered by {len(self._noise)} bytes that are not a frame"
            return self._ended(asked, None, BadAnswer(text, raw=self._noise, **facts))
        return self._ended(asked, None, NoAnswer(f"{who} did not answer", **facts))

    def _refusal(self, request: bytes, answer: bytes) -> Refused | None:
        if answer[1] & 0x80 == 0:
            return None
        unit, code = answer[0], answer[2]
        profile: Profile | None = self._families.of(unit)
        name, meaning = ("", "") if profile is None else profile.exception(code)
        known = f" ({name}: {meaning})" if name else ""
        text = f"unit {unit} refused function {request[1]:02X}H with exception {code:02X}H{known}"
        return Refused(text, code=code, name=name, meaning=meaning, unit=unit, request=request, raw=answer)

    def _beside(self, piece: _Piece) -> Exchange:
        """What belongs to no request that is open."""
        role, data, began, _, gap, _, _, why = piece
        if role == "noise":
            error = CrcError if len(data) >= 4 else BadAnswer
            text = f"{len(data)} bytes are not a frame: {why}"
            return Exchange(None, None, None, began + self._ahead, gap, None, error(text, raw=data), lump=self._lump)
        texts = {
            "late": f"unit {data[0]} answered late, when something else had been asked",
            "doubtful": f"unit {data[0]} answered late, or was asked once more: what was heard does not tell",
        }
        text = texts.get(role, f"unit {data[0]} answered something that was not asked of it")
        wrong = BadAnswer(text, unit=data[0], raw=data)
        return Exchange(data[0], None, data, began + self._ahead, gap, None, wrong, lump=self._lump)


def exchanges_in(
    pieces: Iterable[tuple[float, bytes]], line: SerialFormat, families: Families | None = None
) -> Iterator[Exchange]:
    """The exchanges in *pieces* of a line: Unix times in seconds, and the bytes that had come by then."""
    pairing = Pairing(line, Families() if families is None else families)
    for at, data in pieces:
        yield from pairing.receive(at, data)
    yield from pairing.finish()
