"""What of a TCP connection is Modbus: RTU frames as on a serial line, or Modbus TCP."""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

from drivebus._native import frame_len
from drivebus.capture.frame import Captured
from drivebus.capture.network import Connection, Side
from drivebus.capture.streams import Piece, Record, pieces
from drivebus.rtu import framed, is_frame

__all__ = ["Found", "found_in"]

_HEAD = struct.Struct(">HHHB")
_MOST = 254
"""What the head of Modbus TCP may announce: the unit and the longest PDU."""

_ENOUGH = 0.2
"""So much of what was said must be frames: of other protocols, one part in thousands looks like one by chance."""
_ENOUGH_WITHOUT_CRC = 0.5


@dataclass(frozen=True, slots=True)
class Found:
    """What was found in a connection.

    Attributes:
        kind: "RTU over TCP" or "Modbus TCP".
        frames: In the order of the capture; those of Modbus TCP with each answer behind its request, and with the CRC
            that they would have on a serial line.
        mismatched: How many answers had a transaction number for which nothing was open.
    """

    kind: str
    frames: list[Captured]
    mismatched: int = 0


@dataclass(frozen=True, slots=True)
class _Told:
    """A frame of Modbus TCP."""

    piece: Piece
    transaction: int


def found_in(connection: Connection, number: int) -> Found | None:
    """The Modbus in *connection*, which is *number* of its server's; None where it is another protocol."""
    size = sum(len(record.data) for side in _sides(connection) for run in side.runs for record in run)
    tcp = [list(chain.from_iterable(map(_told, side.runs))) for side in _sides(connection)]
    # As long as its function says is what proves it; a head is longer than a CRC by four bytes.
    length = sum(len(each.piece.data) + 4 for each in chain(*tcp) if _is_shaped(each.piece.data))
    if length and length >= _ENOUGH_WITHOUT_CRC * size:
        asked, answered = tcp
        mismatched, pairs = _paired(asked, answered)
        frames = [_captured(connection, number, piece, asks) for piece, asks in pairs]
        return Found("Modbus TCP", frames, mismatched)
    rtu = [list(chain.from_iterable(map(pieces, side.runs))) for side in _sides(connection)]
    length = sum(len(piece.data) for piece in chain(*rtu) if is_frame(piece.data))
    if not length or length < _ENOUGH * size:
        return None
    both = [(piece, asks) for asks, said in zip((True, False), rtu, strict=True) for piece in said]
    both.sort(key=lambda each: each[0].index)
    return Found("RTU over TCP", [_captured(connection, number, piece, asks) for piece, asks in both])


def _sides(connection: Connection) -> tuple[Side, Side]:
    return connection.asked, connection.answered


def _captured(connection: Connection, number: int, piece: Piece, asks: bool) -> Captured:
    return Captured(piece.time, piece.data, asks if is_frame(piece.data) else None, connection.place, number, True)


def _told(records: Sequence[Record]) -> Iterator[_Told]:
    """The frames of Modbus TCP in *records*, which follow each other without a byte between them missing."""
    data = b"".join(record.data for record in records)
    starts, ends, end = list[int](), list[int](), 0
    for record in records:
        starts.append(end)
        end += len(record.data)
        ends.append(end)
    at = here = 0
    while at + _HEAD.size < len(data):
        transaction, protocol, length, unit = _HEAD.unpack_from(data, at)
        end = at + 6 + length
        if protocol or not 2 <= length <= _MOST or end > len(data) or not data[at + 7] & 0x7F:
            # Whatever that was, the next one begins with a segment.
            behind = bisect_right(starts, at)
            at = starts[behind] if behind < len(starts) else len(data)
            continue
        while ends[here] < end:
            here += 1
        frame = framed(bytes([unit]) + data[at + 7 : end])
        yield _Told(Piece(records[here].index, records[here].time, frame), transaction)
        at = end


def _is_shaped(frame: bytes) -> bool:
    """Whether *frame* is as long as its function says."""
    return frame_len(frame) == len(frame)


def _paired(asked: Sequence[_Told], answered: Sequence[_Told]) -> tuple[int, list[tuple[Piece, bool]]]:
    """How many answers belong to no request by their number, and all frames, each answer behind its request."""
    order = [(told.piece.index, asks, told) for asks, said in ((True, asked), (False, answered)) for told in said]
    order.sort(key=lambda each: each[0])
    groups, open_, mismatched = list[list[tuple[Piece, bool]]](), dict[int, list[tuple[Piece, bool]]](), 0
    for _, asks, told in order:
        group = None if asks else open_.pop(told.transaction, None)
        if group is None:
            mismatched += not asks
            groups.append(group := [])
        group.append((told.piece, asks))
        if asks:
            open_[told.transaction] = group
    return mismatched, list(chain.from_iterable(groups))
