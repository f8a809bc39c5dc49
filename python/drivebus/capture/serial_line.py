"""One interface of a capture that is a serial line: its packets become frames, and who sent each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import chain, pairwise

from drivebus.capture import links
from drivebus.capture.frame import Captured
from drivebus.capture.packets import Interface, Packet
from drivebus.capture.streams import Piece, Record, answers, asks, is_mixed, pieces
from drivebus.rtu import is_frame

__all__ = ["SerialLine"]

_Direction = bool | None


class SerialLine:
    """The line of *interface*, from its packets one by one.

    Attributes:
        interface: Where it was captured.
        events: What happened on the line beside bytes, in words, and how often.
        cut: How many packets were captured in part.
    """

    def __init__(self, interface: Interface) -> None:
        self.interface = interface
        self.events: Counter[str] = Counter()
        self.cut = 0
        self._runs: dict[_Direction, list[list[Record]]] = {True: [[]], False: [[]], None: [[]]}

    def take(self, index: int, packet: Packet) -> None:
        """Takes *packet*, which is at *index* in the file."""
        said = links.said(packet)
        if said.data:
            self._runs[said.outbound][-1].append(Record(index, packet.time, said.data))
        self.cut += packet.is_cut
        if said.event:
            self.events[said.event] += 1
        if said.is_lost:
            # Nobody knows on which side.
            for runs in self._runs.values() if said.outbound is None else [self._runs[said.outbound]]:
                runs.append([])

    def joins(self, other: SerialLine) -> bool:
        """Takes what *other* has as the other side of this line, if one of them has requests alone and one answers."""
        ours, theirs = self._one_way(), other._one_way()
        if ours is None or theirs is None:
            return False
        sides = asks(_frames(_pieces(ours))), asks(_frames(_pieces(theirs)))
        if sides not in ((True, False), (False, True)):
            return False
        self._runs = {sides[0]: ours, sides[1]: theirs, None: [[]]}
        self.events += other.events
        self.cut += other.cut
        return True

    def _one_way(self) -> list[list[Record]] | None:
        """All that was said, if it has one direction."""
        used = [runs for runs in self._runs.values() if any(runs)]
        return used[0] if len(used) == 1 else None

    def frames(self, name: str) -> list[Captured]:
        """The frames and the noise, in the order of the capture; *name* is what the line is called."""
        told = [(piece, direction) for direction, runs in self._runs.items() for piece in _pieces(runs)]
        told.sort(key=lambda each: each[0].index)
        masters = _masters([(piece.data, direction) for piece, direction in told if is_frame(piece.data)])

        def asked(data: bytes, direction: _Direction) -> bool | None:
            is_told = masters is not None and direction is not None and is_frame(data)
            return direction is masters if is_told else None

        return [Captured(piece.time, piece.data, asked(piece.data, direction), name) for piece, direction in told]


def _pieces(runs: Sequence[Sequence[Record]]) -> list[Piece]:
    return list(chain.from_iterable(map(pieces, runs)))


def _frames(said: Sequence[Piece]) -> list[bytes]:
    return [piece.data for piece in said if is_frame(piece.data)]


def _masters(frames: Sequence[tuple[bytes, _Direction]]) -> bool | None:
    """The direction of the master in *frames*: who captures may be the master, or be a unit.

    None where directions do not tell it: who only listens receives both. Where frames do not either, as those of
    writes, it is the direction whose frames the other one answers next; where both do, the outbound one.
    """
    outbound, inbound = ([data for data, way in frames if way is direction] for direction in (True, False))
    if is_mixed(outbound) or is_mixed(inbound):
        return None
    says = [asks(outbound), asks(inbound)]
    if says[0] is not None and says[0] == says[1]:
        return None
    if says == [None, None]:
        begun = [way for (asked, way), (data, other) in pairwise(frames) if way is not other and answers(asked, data)]
        return begun.count(True) >= begun.count(False)
    return says[0] is not False and says[1] is not True
