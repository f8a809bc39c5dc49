"""Many lines in one process, each polled at wire speed: the share of the shortest cycle on each, and the cost.

A process of its own simulates the lines, most behind pseudo-terminals and some behind TCP, with strict units that
answer at once (P14.03 = 0). The measured process has a bus for each and reads words of one unit after the other, by a
thread for each bus.

usage: python -m benches.python.many_lines [--lines 32] [--tcp 4] [--units 8] [--words 1] [--seconds 5] [--json]
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import NamedTuple, cast

from benches.python import programs
from benches.python.figures import markdown, show

import drivebus

BAUDRATE = 19_200
MONITOR, RESPONSE_DELAY = 0x3000, 0x0E03
WARM = 1.0
"""Seconds before anything counts."""
LOOK = 0.1
"""Seconds between two looks at what was polled."""


class Figures(NamedTuple):
    """One measurement."""

    how: str
    lines: int
    units: int
    words: int
    shares: list[float]
    """Of the shortest possible cycle, in percent, a bus each, least first."""
    cores: float
    """Processor time of the measured process, all threads, in a second."""
    simulator_cores: float
    """The same of the process that simulates the lines."""
    reads: int
    """In the measured time, on all buses."""
    missing: int
    """Of all requests, those without an answer: a crowded machine may keep one waiting for longer than the time-out."""
    violations: int
    """Requests that came before the silence was over, from the first one on."""
    asked: int


class Lines:
    """The lines, simulated by another process."""

    def __init__(self, given: argparse.Namespace) -> None:
        command = [sys.executable, "-m", "benches.python.many_lines", "--serve"]
        command += [f"--{name}={getattr(given, name)}" for name in ("lines", "tcp", "units")]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.ports: list[str] = self._ask()

    def _ask(self) -> list[str]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return cast("list[str]", json.loads(self._process.stdout.readline()))

    def counts(self) -> tuple[int, int, float]:
        """Requests, silence violations, and seconds of processor time, so far."""
        requests, violations, seconds = self._ask()
        return int(requests), int(violations), float(seconds)

    def close(self) -> None:
        """Ends the process."""
        self._process.communicate()


def serve(given: argparse.Namespace) -> None:
    """What the other process does: a line of JSON for each line it is given, first of all the ports."""
    with ExitStack() as stack:
        simulators = [
            stack.enter_context(
                drivebus.Simulator(
                    dict.fromkeys(range(1, given.units + 1), "gd350"),
                    baudrate=BAUDRATE,
                    transport="tcp" if line < given.tcp else "pty",
                    strict_silence=True,
                )
            )
            for line in range(given.lines)
        ]
        sys.stdin.readline()
        print(json.dumps([simulator.port for simulator in simulators]), flush=True)
        while sys.stdin.readline():
            lines = [simulator.line for simulator in simulators]
            requests, violations = sum(line.requests for line in lines), sum(line.silence_violations for line in lines)
            print(json.dumps([requests, violations, time.process_time()]), flush=True)


class Clock:
    """The measured time, the same for all buses."""

    def __init__(self, seconds: float) -> None:
        self.begin = time.monotonic() + WARM
        self.end = self.begin + seconds


def by_threads(buses: Sequence[drivebus.Bus], clock: Clock, units: int, words: int) -> list[tuple[int, float]]:
    """`bus.read`, a thread for each bus; returns how many reads took how long, on each."""
    results = [(0, 0.0)] * len(buses)

    def poll(place: int, bus: drivebus.Bus) -> None:
        first, now, count, unit = 0.0, 0.0, 0, 0
        while now < clock.end:
            unit = unit % units + 1
            bus.read(unit, MONITOR, words)
            now = time.monotonic()
            if now >= clock.begin:
                if first:
                    count += 1
                else:
                    first = now
        results[place] = (count, now - first)

    threads = [threading.Thread(target=poll, args=each) for each in enumerate(buses)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results


def by_poll(buses: Sequence[drivebus.Bus], clock: Clock, units: int, words: int) -> list[tuple[int, float]]:
    """`bus.poll`, and one thread that looks at all samples; returns how many reads took how long, on each."""
    unix = time.time() - time.monotonic()
    targets = {unit: [(MONITOR, words)] for unit in range(1, units + 1)}
    answered: list[list[float]] = [[] for _ in buses]
    with ExitStack() as stack:
        polls = [stack.enter_context(bus.poll(targets)) for bus in buses]
        while time.monotonic() < clock.end:
            time.sleep(LOOK)
            for moments, poll in zip(answered, polls, strict=True):
                for sample in poll.take():
                    if sample:
                        moments.append(sample.answered - unix)
        assert not any(poll.dropped for poll in polls)
    within = [[moment for moment in moments if clock.begin <= moment <= clock.end] for moments in answered]
    return [(len(moments) - 1, moments[-1] - moments[0]) for moments in within]


HOW = {"threads": by_threads, "bus.poll": by_poll}


@contextmanager
def opened(ports: Sequence[str], units: int) -> Iterator[list[drivebus.Bus]]:
    """A bus on each port, whose units answer at once."""
    with ExitStack() as stack:
        buses = [stack.enter_context(drivebus.Bus(port, baudrate=BAUDRATE)) for port in ports]

        def prepare(bus: drivebus.Bus) -> None:
            for unit in range(1, units + 1):
                bus.write(unit, RESPONSE_DELAY, 0)

        threads = [threading.Thread(target=prepare, args=(bus,)) for bus in buses]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        yield buses


def measure(given: argparse.Namespace, how: str) -> Figures:
    """One measurement."""
    line = drivebus.SerialFormat(BAUDRATE)
    shortest = (8 + 5 + 2 * given.words) * line.char_time + 2 * line.t35
    lines = Lines(given)
    try:
        with opened(lines.ports, given.units) as buses:
            clock = Clock(given.seconds)
            marks: list[tuple[float, float]] = []

            def mark() -> None:
                for moment in (clock.begin, clock.end):
                    time.sleep(max(0.0, moment - time.monotonic()))
                    marks.append((time.process_time(), lines.counts()[2]))

            marker = threading.Thread(target=mark)
            marker.start()
            results = HOW[how](buses, clock, given.units, given.words)
            marker.join()
            requests, violations, _ = lines.counts()
            missing = sum(bus.stats().timeouts for bus in buses)
    finally:
        lines.close()
    (own_before, other_before), (own, other) = marks
    return Figures(
        how=how,
        lines=given.lines,
        units=given.units,
        words=given.words,
        shares=sorted(100 * shortest * count / seconds for count, seconds in results),
        cores=(own - own_before) / given.seconds,
        simulator_cores=(other - other_before) / given.seconds,
        reads=sum(count for count, _ in results),
        missing=missing,
        violations=violations,
        asked=requests,
    )


HEAD = ["buses", "units each", "words", "polled by", "least share", "median share"]
HEAD += ["cores", "cores of the simulator", "not answered", "silence violations"]


def row(figures: Figures) -> list[str]:
    """For a table."""
    return [
        str(figures.lines),
        str(figures.units),
        str(figures.words),
        figures.how,
        f"{figures.shares[0]:.2f} %",
        f"{statistics.median(figures.shares):.2f} %",
        f"{figures.cores:.2f}",
        f"{figures.simulator_cores:.2f}",
        str(figures.missing),
        f"{figures.violations} of {figures.asked}",
    ]


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--lines", type=int, default=32)
    options.add_argument("--tcp", type=int, default=4, help="of the lines, behind TCP")
    options.add_argument("--units", type=int, default=8, help="on each line")
    options.add_argument("--words", type=int, default=1, choices=range(1, 17))
    options.add_argument("--seconds", type=float, default=5.0)
    options.add_argument("--how", action="append", choices=list(HOW))
    options.add_argument("--runs", type=int, default=1)
    options.add_argument("--idle", action="store_true", help="let the processor idle between, as it will")
    options.add_argument("--realtime", action="store_true", help="on a busy machine: all that is measured goes first")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    options.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.serve:
        serve(given)
        return
    if given.realtime:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(10))  # and so everything that is started from here
    with ExitStack() as stack:
        if not given.idle:
            stack.enter_context(programs.beside("awake"))
        runs = [measure(given, how) for _ in range(given.runs) for how in given.how or HOW]
    show(given.json, [each._asdict() for each in runs], markdown(HEAD, [row(each) for each in runs]))


if __name__ == "__main__":
    main()
