"""Frames in the bytes of a capture: how bytes are cut into records tells little, so they are taken as a stream.

A frame may lie in several records, and a record may hold several frames. A record that is one whole frame is taken as
that first, then what the frames themselves tell of their length; last, what has its CRC right and ends with a record or
where another frame begins, which is how functions of a maker's own are found. What is left is noise, and never longer
than a record.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivebus._native import decode, decode_answer, frame_len
from drivebus.errors import DrivebusError, Refused
from drivebus.rtu import LONGEST, SHORTEST, is_frame

__all__ = ["Piece", "Record", "answers", "asks", "is_mixed", "pieces"]

_MOST_RECORDS = 64
"""A frame of a length that it does not tell lies in so many records at most."""

_FEW = 10
"""Of so many frames one may be what its direction is not: damage can look like a frame."""

_TELLING = 1000
"""So many frames tell what their direction is."""


@dataclass(frozen=True, slots=True)
class Record:
    """Bytes of one direction that a capture has in one packet.

    Attributes:
        index: Its place in the file.
        time: Unix time of its last byte in seconds; None where the capture does not tell.
        data: The bytes.
    """

    index: int
    time: float | None
    data: bytes


@dataclass(frozen=True, slots=True)
class Piece:
    """A frame, or bytes that are none.

    Attributes:
        index: The place in the file of the record with its last byte.
        time: That record's time.
        data: All of it.
    """

    index: int
    time: float | None
    data: bytes


def pieces(records: Sequence[Record]) -> Iterator[Piece]:
    """The frames and the noise in *records*, which follow each other without a byte between them missing."""
    data = b"".join(record.data for record in records)
    ends, end = [], 0
    for record in records:
        end += len(record.data)
        ends.append(end)
    at = noise = 0
    while at < len(data):
        # The record in which the byte at this place is.
        here = bisect_right(ends, at)
        length = _length(data, at, ends, here, at == noise)
        if length:
            if noise < at:
                yield _piece(records, ends, data, noise, at)
            yield _piece(records, ends, data, at, at + length)
            at = noise = at + length
            continue
        at += 1
        if at == ends[here]:
            yield _piece(records, ends, data, noise, at)
            noise = at
    if noise < at:
        yield _piece(records, ends, data, noise, at)


def asks(frames: Sequence[bytes]) -> bool | None:
    """Whether *frames*, all of one direction, are a master's; None where they do not tell, or are of both."""
    requests, answers = _kinds(frames)
    if requests == answers or min(requests, answers) * _FEW > requests + answers:
        return None
    return requests > answers


def answers(request: bytes, answer: bytes) -> bool:
    """Whether the frame *answer* may be what a unit says to *request*."""
    if request[0] != answer[0]:
        return False
    try:
        decode_answer(request, answer)
    except Refused:
        return True
    except DrivebusError:
        return False
    return True


def is_mixed(frames: Sequence[bytes]) -> bool:
    """Whether *frames*, all of one direction, are of masters and units alike: that direction tells nothing."""
    requests, answers = _kinds(frames)
    return min(requests, answers) * _FEW > requests + answers


def _kinds(frames: Sequence[bytes]) -> tuple[int, int]:
    """How many of *frames*, of so many as tell enough, can only be requests, and how many only answers."""
    kinds = [_asks(frame) for frame in frames[:_TELLING]]
    return kinds.count(True), kinds.count(False)


def _length(data: bytes, at: int, ends: Sequence[int], here: int, may_begin: bool) -> int:
    """How long the frame at *at* is, in record *here* which ends with one of *ends*; 0 where none is."""
    if may_begin and is_frame(data[at : ends[here]]):
        return ends[here] - at
    length = frame_len(data[at : at + LONGEST])
    if length is not None:
        return length
    if not may_begin:
        return 0
    for end in ends[here + 1 : here + _MOST_RECORDS]:
        if end - at > LONGEST:
            break
        if is_frame(data[at:end]):
            return end - at
    for length in range(SHORTEST, min(LONGEST, ends[here] - at)):
        if is_frame(data[at : at + length]):
            rest = data[at + length : ends[here]]
            if is_frame(rest) or frame_len(rest) is not None:
                return length
    return 0


def _piece(records: Sequence[Record], ends: Sequence[int], data: bytes, start: int, end: int) -> Piece:
    last = records[bisect_right(ends, end - 1)]
    return Piece(last.index, last.time, data[start:end])


_REQUESTS = {"read", "write_many"}
_ANSWERS = {"read_answer", "write_many_answer", "exception"}


def _asks(frame: bytes) -> bool | None:
    """Whether a master sent *frame*, as far as it tells itself."""
    try:
        kind = decode(frame)["kind"]
    except DrivebusError:
        return None
    return True if kind in _REQUESTS else False if kind in _ANSWERS else None
