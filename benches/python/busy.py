"""The share of the wire on a busy machine: two busy processes for each core, with and without `Bus(realtime=True)`.

One word is read again and again at 115200 bit/s over a pseudo-terminal with the pace of the wire. The line itself runs
in real time, so that what is missing is the master's. drivebus polls, in a thread of the core's own; the C master is
`benches/c/master.c`, at its usual priority and in real time. All take turns, so that each meets the same machine.

usage: python -m benches.python.busy [--runs 5] [--seconds 2] [--json]
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from benches.python import cycle
from benches.python.figures import markdown, show
from benches.python.masters import ADDRESS, UNIT, Order, Worker

import drivebus

BAUDRATE = 115200
FIRST, BEFORE_THE_LINE = 10, 20
"""Priorities of `SCHED_FIFO`: of the C master in real time, and of the line."""


@contextmanager
def line() -> Iterator[str]:
    """The port of a simulated GD350 that answers as soon as it may, in a process of its own."""
    with subprocess.Popen(
        [sys.executable, "-m", "benches.python.busy", "--line"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.stdin.close()


def serve_line() -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(BEFORE_THE_LINE))
    with drivebus.Simulator({UNIT: "gd350"}, baudrate=BAUDRATE, parity="N", stopbits=2) as simulator:
        with drivebus.Bus(simulator.port, baudrate=BAUDRATE, parity="N", stopbits=2) as bus:
            bus.drive(UNIT, "gd350").write(cycle.RESPONSE_DELAY, 0, unverified=True)
        print(simulator.port, flush=True)
        sys.stdin.read()


@contextmanager
def busy() -> Iterator[None]:
    """Two processes for each core that never wait."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def polled(port: str, seconds: float, realtime: bool) -> float:
    """Reads a second."""
    with drivebus.Bus(port, baudrate=BAUDRATE, parity="N", stopbits=2, realtime=realtime) as bus:
        for note in bus.stats().notes:
            print(note, file=sys.stderr)
        with bus.poll({UNIT: [(ADDRESS, 1)]}):
            before, start = bus.stats().answers, time.perf_counter()
            time.sleep(seconds)
            return float(bus.stats().answers - before) / (time.perf_counter() - start)


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--runs", type=int, default=5)
    options.add_argument("--seconds", type=float, default=2.0, help="of each run")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    options.add_argument("--line", action="store_true", help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.line:
        serve_line()
        return
    characters = drivebus.SerialFormat(BAUDRATE, "N", 2)
    least = cycle.shortest(characters, 1)
    with line() as port, busy():
        order = Order(
            port, BAUDRATE, True, characters.char_time, characters.t35, 1,
            warm=5, cycles=round(given.seconds / least), limit=given.seconds,
        )  # fmt: skip

        def in_c(realtime: bool) -> float:
            policy = (os.SCHED_FIFO, FIRST) if realtime else (os.SCHED_OTHER, 0)
            os.sched_setscheduler(0, policy[0], os.sched_param(policy[1]))
            try:
                outcome = Worker("c").run(order)
            finally:
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            return outcome.cycles / outcome.seconds

        masters: dict[str, Callable[[], float]] = {
            "drivebus": lambda: polled(port, given.seconds, False),
            "drivebus, realtime": lambda: polled(port, given.seconds, True),
            "C": lambda: in_c(False),
            "C, realtime": lambda: in_c(True),
        }
        shares: dict[str, list[float]] = {name: [] for name in masters}
        for _ in range(given.runs):
            for name, run in masters.items():
                shares[name].append(100 * least * run())
    figures: list[dict[str, object]] = [
        {"master": name, "share": statistics.median(runs), "shares": sorted(runs)} for name, runs in shares.items()
    ]
    rows = [
        [name, f"{statistics.median(runs):.1f} %", f"{min(runs):.1f} … {max(runs):.1f}"]
        for name, runs in shares.items()
    ]
    show(given.json, figures, markdown(["master", "share of the shortest cycle", "all runs"], rows))


if __name__ == "__main__":
    main()
