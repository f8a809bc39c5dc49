"""Soaks the Python package in real time: threads on one bus behind a pseudo-terminal that fails in every way.

`soak_realtime.py --minutes 60 --seed 7`. Every register that is read has a value that only its unit and address have,
and every value written is written once, so that the drives' own logs say whether anything was wrong, done twice, or
reported and not done. Memory and open files of this process are watched. Exit code 1 when anything was wrong.
"""

from __future__ import annotations

import argparse
import collections
import itertools
import os
import random
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import drivebus

UNITS = range(1, 9)
PLACES = (0x0206, 0x0207, 0x0208)
"""P02.06 to P02.08: parameters that take any word; they are written before the faults begin, and then only read."""
WRITTEN = 0x041B
"""P04.27 takes any word."""
RAM = 0x8000
"""INVT's address bit for RAM."""
ALLOWED = 8.0
"""Seconds after which a call counts as hung: eight units may each be silent for a call before its turn comes."""
REMEMBERED = 500
"""Values of each unit that may be confirmed after its log was last judged."""
SETTLED = 0.25
"""Share of the run after which memory is taken to have its size."""
GROWTH = 2 * 1024
"""KiB of growth after that which would be a leak."""


def known(unit: int, address: int) -> int:
    """The value that only *unit* has at *address*."""
    return unit << 12 | address


class Soak:
    """The bus, what is known of its units, and what came of it."""

    def __init__(self, bus: drivebus.Bus, simulator: drivebus.Simulator, seed: int) -> None:
        self.bus = bus
        self.simulator = simulator
        self.seed = seed
        self.done = threading.Event()
        self.counts: collections.Counter[str] = collections.Counter()
        self.slowest = 0.0
        self._lock = threading.Lock()
        self._next = dict.fromkeys(UNITS, 0)
        self._confirmed: dict[int, list[int]] = {unit: [] for unit in UNITS}
        self._taken: dict[int, list[int]] = {unit: [0] for unit in UNITS}

    def call(self, what: Callable[[], str]) -> None:
        """Makes one call and counts how it ended."""
        began = time.monotonic()
        try:
            ended = what()
        except drivebus.DrivebusError as error:
            ended = type(error).__name__
        took = time.monotonic() - began
        with self._lock:
            self.counts[ended] += 1
            self.counts["hung"] += took > ALLOWED
            self.slowest = max(self.slowest, took)

    def read(self, chance: random.Random) -> str:
        """Reads one to three words, all known."""
        unit, first = chance.choice(UNITS), chance.randrange(len(PLACES))
        count = chance.randint(1, len(PLACES) - first)
        words = self.bus.read(unit, PLACES[first], count)
        right = [known(unit, address) for address in PLACES[first : first + count]]
        return "read" if words == right else f"WRONG: unit {unit}, {words}, not {right}"

    def write(self, chance: random.Random) -> str:
        """Writes a value that no other write has; half of them may be cleared up by reading."""
        unit = chance.choice(UNITS)
        with self._lock:
            self._next[unit] += 1
            value = self._next[unit]
        if value > 0xFFFF:
            return "out of values"
        self.bus.write(unit, RAM | WRITTEN, value, read_back=WRITTEN if chance.random() < 0.5 else None)
        with self._lock:
            self._confirmed[unit].append(value)
        return "written"

    def work(self, number: int) -> None:
        """One thread: mostly reads."""
        chance = random.Random(f"{self.seed}/{number}")
        while not self.done.is_set():
            self.call(lambda: self.write(chance) if number == 0 else self.read(chance))

    def unplug(self) -> None:
        """Pulls the adapter out about twice a minute, and puts it in again under another name."""
        chance = random.Random(f"{self.seed}/cable")
        while not self.done.wait(chance.uniform(15.0, 45.0)):
            self.simulator.line.unplug()
            self.done.wait(chance.uniform(0.1, 2.0))
            self.simulator.line.replug()
            with self._lock:
                self.counts["unplugged"] += 1

    def judge(self) -> list[str]:
        """What the drives' own logs say against the program's. It is forgotten then: memory tells of leaks."""
        wrong = [text for text in self.counts if text.startswith("WRONG")]
        for unit in UNITS:
            # First what was confirmed: all of it was taken before.
            with self._lock:
                confirmed, self._confirmed[unit] = self._confirmed[unit], []
            log = self.simulator.drive(unit).take_writes()
            taken = self._taken[unit] + [value for _, address, value in log if address == RAM | WRITTEN]
            # One thread writes, and never the same again: a value that is not the highest yet was taken twice.
            wrong += [
                f"unit {unit} took {value} after {before}"
                for before, value in itertools.pairwise(taken[len(self._taken[unit]) - 1 :])
                if value <= before
            ]
            wrong += [f"unit {unit} never took {value}" for value in confirmed if value not in taken]
            self._taken[unit] = taken[-REMEMBERED:]
        return wrong


def resident() -> int:
    """KiB of memory that this process has."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024


def open_files() -> int:
    """How many files this process has open."""
    return len(list(Path("/proc/self/fd").iterdir()))


def main() -> int:
    """Runs it, prints what came of it, and returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=random.randrange(2**32))
    parser.add_argument("--rate", type=float, default=0.003, help="of each kind of fault, in every answer")
    asked = parser.parse_args()
    print(f"seed {asked.seed}, {asked.minutes:g} minutes, {asked.rate:g} of each fault", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder, "adapter")
        simulator = drivebus.Simulator(dict.fromkeys(UNITS, "gd350"), baudrate=115200, seed=asked.seed, link=link)
        with simulator, drivebus.Bus(link, baudrate=115200, timeout=0.1) as bus:
            for unit in UNITS:
                for address in PLACES:
                    bus.write(unit, RAM | address, known(unit, address), read_back=address)
            return soak(Soak(bus, simulator, asked.seed), asked.minutes * 60.0, asked.rate)


def soak(run: Soak, seconds: float, rate: float) -> int:
    """Works and watches for *seconds*; the verdict as an exit code."""
    line = run.simulator.line
    line.set_times(late=0.15, overtaken=(0.11, 0.4))
    line.set_faults(all=rate)
    threads = [threading.Thread(target=run.work, args=(number,), daemon=True) for number in range(6)]
    threads.append(threading.Thread(target=run.unplug, daemon=True))
    for thread in threads:
        thread.start()
    began = time.monotonic()
    watched: list[tuple[int, int]] = []
    wrong: list[str] = []
    while (spent := time.monotonic() - began) < seconds:
        if spent >= seconds * SETTLED:
            watched.append((resident(), open_files()))
        time.sleep(min(5.0, seconds / 20))
        wrong += run.judge()
    run.done.set()
    for thread in threads:
        thread.join(4 * ALLOWED)
    stuck = sum(thread.is_alive() for thread in threads)
    wrong += run.judge()
    memory, files = [kib for kib, _ in watched], [count for _, count in watched]
    stats = run.bus.stats()
    print(f"{stats.requests} transactions, {stats.reconnects} times opened again, slowest call {run.slowest:.2f} s")
    print(f"calls: {dict(run.counts.most_common())}")
    print(f"faults: {line.fault_counts()}")
    print(
        f"memory: {memory[0]} to {max(memory)} KiB, at the end {memory[-1]}; open files: {min(files)} to {max(files)}"
    )
    wrong = list(dict.fromkeys(wrong))
    if memory[-1] - memory[0] > GROWTH:
        wrong.append(f"memory grew by {memory[-1] - memory[0]} KiB")
    if max(files) - min(files) > 4:
        wrong.append(f"open files went from {min(files)} to {max(files)}")
    if stuck or run.counts["hung"]:
        wrong.append(f"{stuck} threads did not end, {run.counts['hung']} calls took more than {ALLOWED} s")
    missing = [kind for kind, count in line.fault_counts().items() if count == 0 and kind != "unplug"]
    if missing:
        wrong.append(f"never happened: {', '.join(missing)}")
    print("\n".join(wrong) if wrong else "All of it was true.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
