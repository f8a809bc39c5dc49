"""A line between somebody's master and somebody's unit, with an ear on it, of which the truth is kept.

The ear hands bytes over in lumps, as adapters do. Answers may be spoilt on the way; the truth says which were not.
"""

from __future__ import annotations

import os
import random
import selectors
import threading
import tty
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
from time import monotonic

from drivebus import Exchange, crc16

FAULTS = (
    "flip",
    "lose",
    "double",
    "noise_before",
    "noise_after",
    "noise_inside",
    "silence",
    "late",
    "split",
    "collision",
)

_AHEAD = 10
"""Requests that the ear may have missed in a row."""


@dataclass
class Asked:
    """A request as it was sent, and the answer to it if that went over the line whole and in time."""

    request: bytes
    answer: bytes | None = None


@dataclass
class Tap:
    """What goes over the line.

    Attributes:
        master, unit, ear: What each of the three opens.
        lump: Seconds for which the ear keeps bytes back.
        rate: Share of answers that each kind of fault spoils.
        seed: Of chance.
        asked: The truth.
    """

    lump: float
    rate: float = 0.0
    seed: int = 1
    master: str = ""
    unit: str = ""
    ear: str = ""
    asked: list[Asked] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._chance = random.Random(self.seed)
        self._kept = b""
        self._due = 0.0
        self._late: list[tuple[float, Asked, bytes, bytes]] = []
        self._ends = {}
        self._fds: list[int] = []
        for name in ("master", "unit", "ear"):
            ours, theirs = os.openpty()
            tty.setraw(theirs)
            setattr(self, name, os.ttyname(theirs))
            self._ends[name] = ours
            self._fds += [ours, theirs]
        self._over, self._stop = os.pipe()
        self._fds += [self._over, self._stop]
        self._thread = threading.Thread(target=self._relay, name="tap")
        self._thread.start()

    def settle(self) -> None:
        """Waits until all that was said was handed over to the ear, and read there."""
        end = monotonic() + 10
        with selectors.DefaultSelector() as selector:
            selector.register(self._fds[5], selectors.EVENT_READ)
            # A pseudo-terminal that can be read has not been emptied by who listens.
            while (self._kept or self._late or selector.select(0)) and monotonic() < end:
                threading.Event().wait(0.01)
        threading.Event().wait(0.1)

    def close(self) -> None:
        """Ends the line."""
        os.write(self._stop, b"!")
        self._thread.join()
        for descriptor in self._fds:
            os.close(descriptor)

    def _relay(self) -> None:
        parts = {"master": b"", "unit": b""}
        with selectors.DefaultSelector() as selector:
            for name in ("master", "unit"):
                selector.register(self._ends[name], selectors.EVENT_READ, name)
            selector.register(self._over, selectors.EVENT_READ, None)
            while True:
                for key, _ in selector.select(self._wait()):
                    if key.data is None:
                        return
                    parts[key.data] += os.read(key.fd, 4096)
                    frame = parts[key.data]
                    # Written at once or byte by byte: what is no frame yet is not passed on.
                    if crc16(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
                        continue
                    parts[key.data] = b""
                    if key.data == "master":
                        self.asked.append(Asked(frame))
                        self._pass(frame, "unit")
                    else:
                        self._answer(frame)
                self._hand_over()

    def _wait(self) -> float | None:
        due = [late[0] for late in self._late] + ([self._due] if self._kept else [])
        return max(min(due) - monotonic(), 0.0) if due else None

    def _hand_over(self) -> None:
        now = monotonic()
        for late in [late for late in self._late if late[0] <= now]:
            self._late.remove(late)
            self._deliver(*late[1:])
        if self._kept and now >= self._due:
            os.write(self._ends["ear"], self._kept)
            self._kept = b""

    def _pass(self, data: bytes, to: str) -> None:
        os.write(self._ends[to], data)
        if not self._kept:
            # The ear's own clock runs on, whatever is said.
            self._due = (monotonic() // self.lump + 1) * self.lump if self.lump else monotonic()
        self._kept += data
        if not self.lump:
            self._hand_over()

    def _answer(self, answer: bytes) -> None:
        asked = self.asked[-1]
        spoilt = self._spoilt(answer)
        if spoilt is None:
            return
        if self._hits():
            self._late.append((monotonic() + 0.25 + 0.2 * self._chance.random(), asked, answer, spoilt))
            return
        self._deliver(asked, answer, spoilt)

    def _deliver(self, asked: Asked, answer: bytes, spoilt: bytes) -> None:
        if answer in spoilt and asked is self.asked[-1]:
            asked.answer = answer
        self._pass(spoilt, "master")

    def _spoilt(self, answer: bytes) -> bytes | None:
        data = bytearray(answer)
        at = self._chance.randrange(1, len(data) - 1)
        if self._hits():
            data[at] ^= 1 << self._chance.randrange(8)
        if self._hits():
            del data[at]
        if self._hits():
            data.insert(at, data[at])
        if self._hits():
            data[at:at] = self._noise(3)
        if self._hits():
            data[at : at + 2] = self._noise(3)
        if self._hits():
            data[:0] = self._noise(8)
        if self._hits():
            data += self._noise(8)
        return None if self._hits() else bytes(data)

    def _noise(self, most: int) -> bytes:
        return bytes(
            self._chance.choice((0x00, 0xFF, self._chance.randrange(256))) for _ in range(self._chance.randint(1, most))
        )

    def _hits(self) -> bool:
        return self._chance.random() < self.rate

    @property
    def repeated(self) -> int:
        """Requests that were put again before they were answered: whose the answer is then, nobody there tells."""
        return sum(one.answer is None and one.request == again.request for one, again in pairwise(self.asked))

    def score(self, heard: Iterable[Exchange]) -> tuple[int, int, int]:
        """Intact exchanges, those of them that *heard* has, and pairs that *heard* has and that are none."""
        paired = wrong = place = 0
        for exchange in heard:
            if exchange.request is None:
                continue
            # What is taken for a request and was none is in no place.
            ahead = range(place, min(place + _AHEAD, len(self.asked)))
            found = next((at for at in ahead if self.asked[at].request == exchange.request), None)
            place = place if found is None else found + 1
            if exchange.answer is None:
                continue
            is_pair = found is not None and exchange.answer == self.asked[found].answer
            paired, wrong = paired + is_pair, wrong + (not is_pair)
        return sum(asked.answer is not None for asked in self.asked), paired, wrong


@contextmanager
def tapped(lump: float, rate: float = 0.0, seed: int = 1) -> Iterator[Tap]:
    """A line with an ear, for a block."""
    tap = Tap(lump, rate, seed)
    try:
        yield tap
    finally:
        tap.close()
