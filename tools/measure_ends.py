"""Ends programs that run a motor, in every way and on each kind of port: who went on, and how long a stop took.

`measure_ends.py --times 20 [--port socket …] [--only Ctrl-C …]`. The endings are those of `docs/developers/ends.md`,
and storms of 2 to 20 Ctrl-C, at time-outs of 0.2 to 2 s, beside a thread that waits for a dead unit. Figures by the
wall clock are for people: no test judges by them. Exit code 1 when a motor was left running.
"""

from __future__ import annotations

import argparse
import random
import statistics
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from tests.python import endings  # noqa: E402  # the tests' own programs
from tests.python.ends import DEAD, FORWARD, STOP, Line, dispositions_as_usual, line  # noqa: E402

PORTS = ("native", "serial.Serial", "spy", "socket", "asyncio")
STORM = "Ctrl-C, 2 to 20 times"
PATIENCE = 15.0
"""Seconds after which a motor that still runs is taken to run on."""


@dataclass
class Outcome:
    """What became of one ending on one kind of port."""

    runs: int = 0
    left_running: int = 0
    odd: list[str] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)

    def __str__(self) -> str:
        took = "by its watchdog"
        if self.delays:
            took = f"{1e3 * statistics.median(self.delays):.0f} / {1e3 * max(self.delays):.0f} ms"
        return f"{self.left_running} of {self.runs}, {took}"


def endings_of(port: str, rng: random.Random, only: set[str]) -> Iterator[tuple[str, endings.Ending, float]]:
    """Name, ending and time-out of each of one round."""
    rows: Iterable[endings.Ending] = endings.AWAITED_ENDINGS if port == "asyncio" else endings.ENDINGS
    storm = endings.awaited_storm if port == "asyncio" else endings.storm
    for row in rows:
        name = STORM if row.storm else row.name
        if not only or name in only:
            if row.storm:
                yield name, storm(rng.randint(2, 20)), rng.uniform(0.2, 2.0)
            else:
                yield name, row, 1.0


def end(there: Line, ending: endings.Ending, timeout: float, outcome: Outcome, rng: random.Random) -> None:
    """Ends one program, and looks at the drive."""
    outcome.runs += 1
    with there.start(ending.body, timeout) as program:
        program.says("running")
        while ending.storm and not there.asked(DEAD):
            time.sleep(0.001)
        if ending.storm:
            # At any moment of the wait for the dead unit.
            time.sleep(rng.uniform(0.0, timeout))
        began = there.simulator.now()
        for number in ending.signals:
            program.child.send_signal(number)
            if ending.storm:
                time.sleep(rng.choice((0.0, 0.001, 0.01, 0.05)))
        try:
            code, _, said = program.ends(60.0)
        except subprocess.TimeoutExpired:
            code, said = -1, "it hangs"
    if code != ending.code:
        outcome.odd.append(f"exit code {code}: {said[-300:]}")
    deadline = time.monotonic() + PATIENCE
    while there.runs_on() and time.monotonic() < deadline:
        time.sleep(0.01)
    outcome.left_running += there.runs_on()
    started = max(at for at, command in there.told() if command == FORWARD)
    stops = [at for at, command in there.told() if command == STOP and at >= started]
    if stops:
        outcome.delays.append(max(0.0, stops[0] - began))


def measure(port: str, times: int, seed: int, only: set[str]) -> dict[str, Outcome]:
    """All endings on one kind of port, so many times."""
    outcomes: dict[str, Outcome] = {}
    rng = random.Random(f"{seed} {port}")
    for _ in range(times):
        for name, ending, timeout in endings_of(port, rng, only):
            with line("native" if port == "asyncio" else port) as there:
                end(there, ending, timeout, outcomes.setdefault(name, Outcome()), rng)
    return outcomes


def main() -> int:
    """Measures, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--port", action="append", choices=PORTS)
    parser.add_argument("--only", action="append", default=[], help=f"a row of docs/developers/ends.md, or {STORM!r}")
    given = parser.parse_args()
    dispositions_as_usual()
    ports = given.port or PORTS
    with ThreadPoolExecutor(len(ports)) as pool:
        jobs = {port: pool.submit(measure, port, given.times, given.seed, set(given.only)) for port in ports}
        table = {port: job.result() for port, job in jobs.items()}
    names = list(dict.fromkeys(name for port in ports for name in table[port]))
    print(f"| the program ends by | {' | '.join(ports)} |")
    print(f"| --- |{' --- |' * len(ports)}")
    for name in names:
        print(f"| {name} | {' | '.join(str(table[port].get(name, '')) for port in ports)} |")
    print("\nMotors left running, and the time until the stop was on the wire: median / longest.")
    for port in ports:
        for name, outcome in table[port].items():
            for odd in outcome.odd:
                print(f"{port}, {name}: {odd}")
    return int(any(outcome.left_running for port in ports for outcome in table[port].values()))


if __name__ == "__main__":
    sys.exit(main())
