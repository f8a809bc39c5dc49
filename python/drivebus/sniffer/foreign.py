"""Exchanges in Huanyang's own protocol among those of Modbus: the core tells its frames as strays, requests, noise."""

from __future__ import annotations

from collections.abc import Iterator

from drivebus.errors import NoAnswer
from drivebus.line import huanyang
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.families import Families

__all__ = ["Foreign"]

_Piece = tuple[str, bytes, float, float, "float | None", float, "float | None", "str | None"]

_ANSWERS_WITHIN = 1.0
"""Seconds after which a frame is a request of its own."""


class Foreign:
    """The units of a line that speak Huanyang's own protocol, and what was asked of them.

    A unit is one of them once a frame of its came that Modbus does not have; or two of the shape in a row that belong
    together, the first of which nobody had asked for.

    Args:
        families: Which family each unit is of: such a unit is of none.
        ahead: Seconds that Unix time is ahead of the moments that are given.
    """

    def __init__(self, families: Families, ahead: float) -> None:
        self._families = families
        self._ahead = ahead
        self._units: set[int] = set()
        self._asked: tuple[bytes, _Piece, float] | None = None
        self._unsure: bytes | None = None

    def takes(self, piece: _Piece) -> bool:
        """Whether *piece* is of such a unit."""
        role, data = piece[:2]
        unsure, self._unsure = self._unsure, None
        frames = huanyang.frames_in(data)
        if frames is None:
            return False
        if role != "answer":
            for frame in frames:
                belongs = unsure is not None and huanyang.belong(unsure, frame)
                if belongs or huanyang.is_sure(frame):
                    self._units.add(frame[0])
                    self._families.set_apart(frame[0])
                unsure = frame if role == "stray" else None
            self._unsure = unsure
        return all(frame[0] in self._units for frame in frames)

    def has(self, piece: _Piece) -> bool:
        """Whether *piece* was a frame of such a unit."""
        return piece[1][0] in self._units and huanyang.has_form(piece[1])

    def hear(self, piece: _Piece, lump: float) -> Iterator[Exchange]:
        """Takes *piece*, which is of such units; what is decided by then. *lump*: see `Exchange`."""
        began = piece[2]
        for frame in huanyang.frames_in(piece[1]) or ():
            if self._asked is not None:
                request, asked, _ = self._asked
                if huanyang.belong(request, frame) and began - asked[3] <= _ANSWERS_WITHIN:
                    self._asked = None
                    yield self._exchange(request, asked, frame, piece, lump)
                    continue
                yield from self.settle()
            self._asked = (frame, piece, lump)

    def settle(self, until: float | None = None) -> Iterator[Exchange]:
        """What was asked before *until* and never answered; None: at all."""
        if self._asked is not None and (until is None or self._asked[1][3] < until):
            request, asked, lump = self._asked
            self._asked = None
            yield self._exchange(request, asked, None, None, lump)

    def _exchange(
        self, request: bytes, asked: _Piece, answer: bytes | None, came: _Piece | None, lump: float
    ) -> Exchange:
        unit = request[0]
        error = None
        if answer is None and unit:
            error = NoAnswer(f"unit {unit} did not answer", unit=unit, request=request, started=asked[2] + self._ahead)
        return Exchange(
            unit=unit,
            request=request,
            answer=answer,
            time=asked[2] + self._ahead,
            gap=asked[4],
            turnaround=None if came is None or came is asked else max(came[2] - asked[3], 0.0),
            error=error,
            answered=None if came is None else came[3] + self._ahead,
            lump=lump,
            protocol="huanyang",
        )
