"""What a gateway costs: reads by Modbus TCP through it, beside the same reads by the bus itself, in turns.

A process of its own simulates one unit that answers at once (P14.03 = 0), behind a pseudo-terminal with the pace of the
wire. The shortest cycle is that of benches/python/cycle.py.

usage: python -m benches.python.gateway [--baud 19200,115200] [--seconds 2] [--runs 5] [--json]
"""

from __future__ import annotations

import argparse
import socket
import statistics
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from benches.python.figures import markdown, show

import drivebus

WORDS, MONITOR, RESPONSE_DELAY = 1, 0x3000, 0x0E03
CLIENTS, IN_FLIGHT = 4, 4


class Way(NamedTuple):
    """One way to read, at one speed."""

    baudrate: int
    how: str
    share: float
    """Of the shortest possible cycle, in percent."""
    median: float
    """Seconds that one read takes, from its call to its answer."""
    longest: float
    """The same, of 99 in 100."""


def serve(baudrate: int) -> None:
    """What the other process does: says the port, and ends when its input does."""
    with drivebus.Simulator({1: "gd350"}, baudrate=baudrate, transport="pty", strict_silence=True) as simulator:
        print(simulator.port, flush=True)
        sys.stdin.read()


@contextmanager
def served(baudrate: int) -> Iterator[str]:
    """The port of a line that another process simulates."""
    words = [sys.executable, "-m", "benches.python.gateway", "--serve", str(baudrate)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.stdin.close()


def by_bus(bus: drivebus.Bus, seconds: float) -> tuple[list[float], float]:
    """How long each read took, and all of them."""
    return timed(lambda: bus.read(1, MONITOR, WORDS), seconds)


def timed(read: Callable[[], object], seconds: float) -> tuple[list[float], float]:
    """As `by_bus`, of whatever reads."""
    began = now = time.monotonic()
    took = []
    while now < began + seconds:
        read()
        then, now = now, time.monotonic()
        took.append(now - then)
    return took, now - began


class Client:
    """A client of Modbus TCP, as bare as can be."""

    def __init__(self, gateway: drivebus.Gateway) -> None:
        host, port = gateway.address.rsplit(":", 1)
        self._socket = socket.create_connection((host, int(port)))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, number: int = 0) -> None:
        """A request leaves; each *number*, 0..15, asks for another word: the same reads that wait are asked once."""
        self._socket.sendall(struct.pack(">HHHBBHH", number, 0, 6, 1, 3, MONITOR + number, WORDS))

    def hear(self) -> int:
        """An answer comes; its number."""
        answer = self._socket.recv(9 + 2 * WORDS, socket.MSG_WAITALL)
        if answer[7:9] != bytes([3, 2 * WORDS]):
            raise RuntimeError(f"a read was answered by {answer.hex(' ')}")
        return answer[1]

    def read(self) -> None:
        """One after the other."""
        self.ask()
        self.hear()

    def close(self) -> None:
        """Hangs up."""
        self._socket.close()


def by_one(gateway: drivebus.Gateway, seconds: float) -> tuple[list[float], float]:
    """As `by_bus`, by one client that asks when it has heard."""
    client = Client(gateway)
    try:
        return timed(client.read, seconds)
    finally:
        client.close()


def by_several(gateway: drivebus.Gateway, seconds: float) -> tuple[list[float], float]:
    """By several that each have some requests on their way; how long is from answer to answer."""
    counts = [0] * CLIENTS
    end = time.monotonic() + seconds

    def push(place: int) -> None:
        client = Client(gateway)
        for number in range(IN_FLIGHT):
            client.ask(place * IN_FLIGHT + number)
        while time.monotonic() < end:
            number = client.hear()
            counts[place] += 1
            client.ask(number)
        client.close()

    threads = [threading.Thread(target=push, args=(place,)) for place in range(CLIENTS)]
    began = time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    took = time.monotonic() - began
    return [took / sum(counts)] * sum(counts), took


def measured(baudrate: int, seconds: float, runs: int) -> list[Way]:
    """All ways at this speed, in turns."""
    with (
        served(baudrate) as port,
        drivebus.Bus(port, baudrate=baudrate, share="never") as bus,
        drivebus.Gateway(bus, "127.0.0.1:0") as gateway,
    ):
        bus.write(1, RESPONSE_DELAY | 0x8000, 0)
        line = bus.format
        shortest = (8 + 5 + 2 * WORDS) * line.char_time + 2 * line.t35
        ways: dict[str, Callable[[], tuple[list[float], float]]] = {
            "the bus": lambda: by_bus(bus, seconds),
            "one client": lambda: by_one(gateway, seconds),
            f"{CLIENTS} clients with {IN_FLIGHT} requests each": lambda: by_several(gateway, seconds),
        }
        found: dict[str, list[tuple[list[float], float]]] = {how: [] for how in ways}
        for _ in range(runs):
            for how, read in ways.items():
                found[how].append(read())
    rows = []
    for how, parts in found.items():
        every = sorted(one for took, _ in parts for one in took)
        share = statistics.median(100 * shortest * len(took) / whole for took, whole in parts)
        rows.append(Way(baudrate, how, share, statistics.median(every), every[int(len(every) * 0.99)]))
    return rows


def row(way: Way, local: Way) -> list[str]:
    """For a table; *local* is the bus at that speed."""
    alone = way.how == "one client"
    return [
        str(way.baudrate),
        way.how,
        f"{way.share:.2f} %",
        f"{1e3 * (way.median - local.median):+.3f} ms" if alone else "",
        f"{1e3 * (way.longest - local.longest):+.3f} ms" if alone else "",
    ]


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--baud", default="19200,115200")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--serve", type=int)
    given = parser.parse_args()
    if given.serve:
        serve(given.serve)
        return
    found = [measured(int(baudrate), given.seconds, given.runs) for baudrate in given.baud.split(",")]
    titles = ["bit/s", "read by", "share of the shortest cycle", "added, median", "added, 99th percentile"]
    rows = [row(way, ways[0]) for ways in found for way in ways]
    show(given.json, [way._asdict() for ways in found for way in ways], markdown(titles, rows))


if __name__ == "__main__":
    main()
