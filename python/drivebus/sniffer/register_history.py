"""Which words the registers of a capture had, and when: answers to reads that nobody made there."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from drivebus.rtu import framed
from drivebus.sniffer.exchange import Exchange
from drivebus.sniffer.frames import carried, place_of, written_by

__all__ = ["Seen"]

_READ = 0x03


class Seen:
    """The registers that were read (03H) in *exchanges*, with the words they had.

    A write that was taken changes such a register. One that was only written is not among them: what it reads as is not
    known.
    """

    def __init__(self, exchanges: Sequence[Exchange]) -> None:
        self._words: dict[tuple[int, int], list[tuple[int, int]]] = {}
        read = {(unit, address) for _, unit, address, _ in _told(exchanges, writes=False)}
        for at, unit, address, word in _told(exchanges, writes=True):
            if (unit, address) in read:
                self._words.setdefault((unit, address), []).append((at, word))

    def answer(self, request: bytes, now: int) -> bytes | None:
        """The answer to *request* when exchange number *now* was the last: each word the latest, or else the first.

        None of what is no read, and where a register was never read there.
        """
        place = place_of(request)
        if place is None or request[1] != _READ or not 1 <= place[1] <= _MOST:
            return None
        words = [self._word(request[0], address, now) for address in range(place[0], sum(place))]
        data = b"".join(word.to_bytes(2, "big") for word in words if word is not None)
        if len(data) < 2 * len(words):
            return None
        return framed(bytes([request[0], _READ, len(data)]) + data)

    def _word(self, unit: int, address: int, now: int) -> int | None:
        words = self._words.get((unit, address))
        if words is None:
            return None
        return words[max(bisect_right(words, (now, 0xFFFF)) - 1, 0)][1]


_MOST = 125
"""Words of the longest answer."""


def _told(exchanges: Sequence[Exchange], writes: bool) -> list[tuple[int, int, int, int]]:
    """What was read, and what was written if *writes*: the number of its exchange, unit, address and word."""
    told: list[tuple[int, int, int, int]] = []
    for at, exchange in enumerate(exchanges):
        request, answer = exchange.request, exchange.answer
        if request is None or answer is None or exchange.error is not None or (place := place_of(request)) is None:
            continue
        words = written_by(request) if writes else None
        if words is None:
            words = carried(answer, request) if request[1] == _READ == answer[1] else None
        told += [(at, request[0], address, word) for address, word in enumerate(words or (), place[0])]
    return told
