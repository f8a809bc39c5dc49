"""A drive on a pseudo-terminal in a process of its own, which says on a pipe what it hears and what its motor does.

It keeps its own truth: the motor, and a bus time-out that switches the motor off when no frame comes for this unit. Who
waits for something waits on the pipe. As a program: `python -m tests.python.workshop`, or by its path.

On standard input it is told what to do: `refuse HEX [SECONDS]` answers each halt with this exception, `silent` answers
no halt, `coast HEX` answers a stop alone with this exception, `stuck` confirms each halt and runs on, `take` takes them
again, `code HEX` is the identification from then on. `eds300` puts an EDS300 in its place, which runs if it did.
"""

from __future__ import annotations

import os
import queue
import select
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import NamedTuple

__all__ = ["Said", "Workshop"]

CONTROL, STATE, IDENTIFICATION, TIMEOUT = 0x2000, 0x2100, 0x2103, 0x0E04
RUN, STOP, COAST = 1, 5, 6
EDS300 = {0x2100, 0x2180, *range(0x1000, 0x100D)}
"""What an EDS300 answers; by 5 it runs, and by 6 it stops (its manual, pp. 44 and 45)."""
LIMIT = 20.0
"""Seconds after which a test has failed that waits for something."""


class Said(NamedTuple):
    """One thing that it said: when, by the system's monotonic clock, what kind of thing, and the thing."""

    at: float
    kind: str
    what: str

    @property
    def is_halt(self) -> bool:
        """Whether it was told to halt."""
        return self.kind == "frame" and self.what in ("010620000005", "010620000006")


class Workshop:
    """The process of a drive, and what it said so far."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1
        )
        assert self.process.stdout is not None
        self.port = self.process.stdout.readline().strip()
        self.said: list[Said] = []
        self._coming: queue.Queue[Said] = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            at, kind, what = line.split()
            self._coming.put(Said(float(at), kind, what))

    def wait_for(self, wanted: Callable[[Said], bool], since: float = 0.0) -> Said:
        """The first thing said *since* then that is *wanted*."""
        for said in self.said:
            if said.at >= since and wanted(said):
                return said
        while True:
            said = self._coming.get(timeout=LIMIT)
            self.said.append(said)
            if said.at >= since and wanted(said):
                return said

    def tell(self, words: str) -> float:
        """Tells it what to do. Returns the moment from which on it does so."""
        assert self.process.stdin is not None
        self.process.stdin.write(words + "\n")
        self.process.stdin.flush()
        return self.wait_for(lambda said: said.kind == "told" and said.what == words.replace(" ", "_")).at

    def frames(self, since: float) -> list[Said]:
        """What came for the drive since then, as far as somebody waited for it."""
        return [said for said in self.said if said.kind == "frame" and said.at >= since]

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self._reader.join()  # of a pipe that it reads, which is closed now
        self.process.communicate()


def _crc(data: bytes) -> bytes:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


class _Drive:
    """What a drive does with what it hears, and with time."""

    def __init__(self) -> None:
        self.words: dict[int, int] = {}
        self.code = 0x01A0
        self.runs = False
        self.is_eds300 = False
        self.heard = time.monotonic()
        self.halts = "take"
        self.refuses_until = float("inf")

    def say(self, kind: str, what: str) -> None:
        print(f"{time.monotonic():.6f} {kind} {what}", flush=True)

    def turn(self, runs: bool, why: str) -> None:
        if runs != self.runs:
            self.runs = runs
            self.say("runs" if runs else "stands", why)

    def look_at_the_clock(self) -> None:
        limit = self.words.get(TIMEOUT, 0) / 10
        if limit and self.runs and time.monotonic() - self.heard > limit:
            self.turn(False, "time-out")

    def answer(self, pdu: bytes) -> bytes | None:
        self.heard = time.monotonic()
        address, value = struct.unpack(">HH", pdu[1:5])
        if pdu[0] == 3 and self.is_eds300 and not EDS300.issuperset(range(address, address + value)):
            return bytes([0x83, 2])
        if pdu[0] == 3:
            return bytes([3, 2 * value]) + b"".join(struct.pack(">H", self.word(address + n)) for n in range(value))
        if pdu[0] == 8:
            return pdu
        written = [value] if pdu[0] == 6 else list(struct.unpack(f">{value}H", pdu[6:]))
        if self.heard >= self.refuses_until:
            self.halts = "take"
        is_halt = address == CONTROL and written[0] in (STOP, COAST)
        is_halt = is_halt and not (self.halts.startswith("coast") and written[0] == COAST)
        if is_halt and self.halts == "stuck":
            return pdu
        if is_halt and self.halts != "take":
            return None if self.halts == "silent" else bytes([pdu[0] | 0x80, int(self.halts.split()[1], 16)])
        for at, word in enumerate(written, address):
            self.words[at & 0x7FFF] = word
            if at == CONTROL and word in (RUN, STOP, COAST):
                self.turn(word in ((STOP,) if self.is_eds300 else (RUN,)), f"{word}")
        return pdu if pdu[0] == 6 else pdu[:5]

    def word(self, address: int) -> int:
        own = {STATE: 1 if self.runs else 3, STATE + 1: 2 << 5, IDENTIFICATION: self.code, 0x3000: 1000 * self.runs}
        settings = {1: 2, 3: 5000, 4: 5000, 6: 8, 0x3001: 1000, 0x3002: 5400}
        return self.words.get(address) or own.get(address, settings.get(address, 0))


def _serve() -> None:
    import tty  # there is none on Windows, where the other side of this file may be imported

    master, slave = os.openpty()
    tty.setraw(master)
    tty.setraw(slave)
    print(os.ttyname(slave), flush=True)
    drive = _Drive()
    came = b""
    while True:
        ready, _, _ = select.select([master, 0], [], [], 0.02)
        drive.look_at_the_clock()
        if 0 in ready:
            words = sys.stdin.readline().strip()
            if words.startswith("code"):
                drive.code = int(words.split()[1], 16)
            elif words == "eds300":
                drive.is_eds300 = True
            elif words:
                drive.halts = words
                seconds = words.split()[2:]
                drive.refuses_until = time.monotonic() + float(seconds[0]) if seconds else float("inf")
            drive.say("told", words.replace(" ", "_") or "nothing")
        if master not in ready:
            came = b"" if not ready else came
            continue
        came += os.read(master, 512)
        while len(came) >= 8:
            length = 9 + came[6] if came[1] == 0x10 else 8
            if len(came) < length:
                break
            frame, came = came[:length], came[length:]
            if _crc(frame[:-2]) != frame[-2:]:
                came = b""
                break
            drive.say("frame", frame[:-2].hex())
            answer = drive.answer(frame[1:-2]) if frame[0] == 1 else None
            if answer is not None:
                os.write(master, frame[:1] + answer + _crc(frame[:1] + answer))


if __name__ == "__main__":
    _serve()
