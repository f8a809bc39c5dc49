"""Measures what answers that come late, behind later ones, do to a bus: wrong values, failed reads, requests, time.

A slave of its own in plain Python, in a process of its own, answers reads of eight registers in four lengths, and
refuses those that go beyond its last one, as drives do at the end of a block. Each answer carries the number of the
request it was given for, so that one taken for another request shows at once, also where the same register was asked
for. What happens to a share of its answers:

    overtaken  they come 1.1 to 4 time-outs late, and whatever is answered meanwhile goes before
    lost       they never come
    none       nothing: what being careful costs where all is well

    python tools/measure_overtaking.py [--reads 20000] [--timeout 0.05] [--lines pty socket tcp] [--faults overtaken]

The reads are those of one kind of line under one fault, shared by its cells: a unit that answers the loop-back (08H),
one that refuses it and one that is silent on it, each without retries and with the default. The exit code is 1 where a
value was wrong. Linux only.
"""

from __future__ import annotations

import argparse
import contextlib
import heapq
import itertools
import multiprocessing
import os
import random
import select
import socket
import sys
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from drivebus import Bus, DrivebusError

UNIT = 1
REGISTERS, LENGTHS = range(8), (1, 2, 3, 5)
# The number of a request and its register in one word: 13 bits and 3. A number comes again after 8192 requests.
NUMBERS = 1 << 13
END = max(REGISTERS) + max(LENGTHS)  # no register from here on
READ, LOOP_BACK, ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 0x03, 0x08, 0x01, 0x02
DELAY = (0.001, 0.003)  # seconds that the unit takes to answer
LATENESS = (1.1, 4.0)  # time-outs
GAP = 0.002  # seconds between two answers: more than 3.5 characters
LINES, LOOP_BACKS, FAULTS = ("pty", "socket", "tcp"), ("answered", "refused", "silent"), ("overtaken", "lost", "none")
WARM = 1.2  # seconds until the time of first contact is over


@dataclass(frozen=True)
class Cell:
    """One line of the table."""

    line: str
    loop_back: str
    retries: int | None
    fault: str
    rate: float
    timeout: float
    reads: int
    seed: int


@dataclass
class Tally:
    """What came of the reads of a cell."""

    wrong: int = 0
    failed: int = 0
    requests: int = 0
    seconds: float = 0.0


# --- the slave ----------------------------------------------------------------------------------------------


def crc(data: bytes) -> bytes:
    """CRC-16/MODBUS, low byte first, bit by bit."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return register.to_bytes(2, "little")


def words(number: int, address: int, count: int) -> list[int]:
    """What the registers hold in the answer to request *number*."""
    return [(number % NUMBERS) << 3 | (address + place) & 7 for place in range(count)]


class Slave:
    """One unit. `received` counts its requests where the judge can see them; `spoils` says whether faults happen."""

    def __init__(self, cell: Cell, received: Any, spoils: Any) -> None:
        self._cell = cell
        self._received = received
        self._spoils = spoils
        self._chance = random.Random(cell.seed)
        self._outbox: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self._free = 0.0

    def serve(self, told: Connection) -> None:
        """Tells where it listens, and answers until the other end of *told* is closed."""
        own = self._listen(told)
        received = bytearray()
        with contextlib.suppress(OSError, EOFError):
            while True:
                ready, _, _ = select.select([own, told.fileno()], [], [], self._send_due(own))
                if told.fileno() in ready:
                    told.recv()
                if own in ready:
                    received += os.read(own, 4096)
                    for header, unit, pdu in self._requests(received):
                        self._take(header, unit, pdu)

    def _listen(self, told: Connection) -> int:
        """The descriptor that requests come from; the process keeps it to its end."""
        if self._cell.line == "pty":
            own, port = os.openpty()
            tty.setraw(port)
            told.send(os.ttyname(port))
            return own
        with socket.create_server(("127.0.0.1", 0)) as listener:
            told.send(f"{self._cell.line}://127.0.0.1:{listener.getsockname()[1]}")
            connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection.detach()

    def _requests(self, received: bytearray) -> Iterator[tuple[bytes, int, bytes]]:
        """Takes the whole requests out of *received*: transaction, unit, PDU. All that it is asked has 5 bytes."""
        head, tail = (6, 0) if self._cell.line == "tcp" else (0, 2)
        size = head + 6 + tail
        while len(received) >= size:
            frame = bytes(received[:size])
            if tail and crc(frame[:-2]) != frame[-2:]:
                del received[0]
                continue
            del received[:size]
            yield frame[:2], frame[head], frame[head + 1 : head + 6]

    def _take(self, transaction: bytes, unit: int, pdu: bytes) -> None:
        self._received.value += 1
        number = self._received.value
        if unit != UNIT or (pdu[0] == LOOP_BACK and self._cell.loop_back == "silent"):
            return
        if pdu[0] == READ:
            address, count = int.from_bytes(pdu[1:3], "big"), int.from_bytes(pdu[3:5], "big")
            shown = b"".join(word.to_bytes(2, "big") for word in words(number, address, count))
            there = address + count <= END
            answer = bytes([READ, 2 * count]) + shown if there else bytes([READ | 0x80, ILLEGAL_ADDRESS])
        elif pdu[0] == LOOP_BACK and self._cell.loop_back == "answered":
            answer = pdu
        else:
            answer = bytes([pdu[0] | 0x80, ILLEGAL_FUNCTION])
        due = time.monotonic() + self._chance.uniform(*DELAY)
        if self._spoils.value and self._chance.random() < self._cell.rate:
            if self._cell.fault == "lost":
                return
            if self._cell.fault == "overtaken":
                due += self._cell.timeout * self._chance.uniform(*LATENESS)
        body = bytes([unit]) + answer
        if self._cell.line == "tcp":
            body = transaction + b"\0\0" + len(body).to_bytes(2, "big") + body
        else:
            body += crc(body)
        heapq.heappush(self._outbox, (due, next(self._order), body))

    def _send_due(self, own: int) -> float | None:
        """Sends what is due; seconds until more is."""
        while self._outbox:
            wait = max(self._outbox[0][0], self._free) - time.monotonic()
            if wait > 0:
                return wait
            os.write(own, heapq.heappop(self._outbox)[2])
            self._free = time.monotonic() + GAP
        return None


def serve(cell: Cell, received: Any, spoils: Any, told: Connection) -> None:
    """The process of the slave."""
    Slave(cell, received, spoils).serve(told)


# --- the judge ----------------------------------------------------------------------------------------------


def asked_so_far(bus: Bus, received: Any) -> int:
    """How many requests the slave has, once it has all that the bus sent."""
    sent, patience = bus.stats()["requests"], time.monotonic() + 5.0
    while received.value < sent and time.monotonic() < patience:
        time.sleep(0.000_1)
    return int(received.value)


def is_right(came: list[int], address: int, count: int, before: int, after: int) -> bool:
    """Whether *came* answers one of the requests that the slave got after *before* and up to *after*."""
    return any(came == words(number, address, count) for number in range(before + 1, after + 1))


def read_all(bus: Bus, cell: Cell, received: Any) -> Tally:
    """The reads of a cell."""
    tally, chance = Tally(), random.Random(cell.seed + 1)
    first, began = asked_so_far(bus, received), time.monotonic()
    for _ in range(cell.reads):
        address, count = chance.choice(REGISTERS), chance.choice(LENGTHS)
        before = asked_so_far(bus, received)
        try:
            came = bus.read(UNIT, address, count)
        except DrivebusError:
            tally.failed += 1
        else:
            tally.wrong += not is_right(came, address, count, before, received.value)
    tally.seconds = time.monotonic() - began
    tally.requests = asked_so_far(bus, received) - first
    return tally


def measure(cell: Cell) -> Tally:
    """One cell, with a slave and a bus of its own."""
    context = multiprocessing.get_context("spawn")
    received, spoils = context.Value("Q", 0, lock=False), context.Value("b", 0, lock=False)
    told, tells = context.Pipe()
    slave = context.Process(target=serve, args=(cell, received, spoils, tells))
    slave.start()
    tells.close()
    port, timeout = told.recv(), cell.timeout
    with (
        Bus(port, baudrate=115200, parity="N", timeout=timeout)
        if cell.retries is None
        else Bus(port, baudrate=115200, parity="N", timeout=timeout, retries=cell.retries)
    ) as bus:
        warm = time.monotonic() + WARM
        while time.monotonic() < warm:
            with contextlib.suppress(DrivebusError):
                bus.read(UNIT, 0)
        spoils.value = 1
        tally = read_all(bus, cell, received)
    told.close()
    slave.join()
    return tally


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--reads", type=int, default=20_000)
    parser.add_argument("--timeout", type=float, default=0.05, help="seconds")
    parser.add_argument("--rate", type=float, default=0.02, help="share of answers that the fault hits")
    parser.add_argument("--lines", nargs="+", choices=LINES, default=LINES)
    parser.add_argument("--loop-back", nargs="+", choices=LOOP_BACKS, default=LOOP_BACKS)
    parser.add_argument("--retries", nargs="+", choices=("0", "default"), default=("0", "default"))
    parser.add_argument("--faults", nargs="+", choices=FAULTS, default=FAULTS)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    kinds = list(itertools.product(given.loop_back, given.retries))
    reads = -(-given.reads // len(kinds))
    milliseconds = 1e3 * given.timeout
    print(f"{reads} reads a cell, time-out {milliseconds:g} ms, {given.rate:.1%} of answers, seed {given.seed}\n")
    print("| answers | line | 08H | retries | wrong | failed | requests a read | ms a read |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |", flush=True)
    wrong = 0
    for fault, line in itertools.product(given.faults, given.lines):
        for loop_back, retries in kinds:
            allowed = None if retries == "default" else int(retries)
            cell = Cell(line, loop_back, allowed, fault, given.rate, given.timeout, reads, given.seed)
            tally = measure(cell)
            wrong += tally.wrong
            print(
                f"| {fault} | {line} | {loop_back} | {retries} | {tally.wrong} | {tally.failed} "
                f"| {tally.requests / reads:.3f} | {1e3 * tally.seconds / reads:.2f} |",
                flush=True,
            )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
