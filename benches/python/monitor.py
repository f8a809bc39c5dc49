"""What reading a drive by names costs beyond the line: processor time of `drive.monitor()`, a poll, and raw reads.

At the other end is the slave in C that answers at once (see `unpaced`); all 23 monitor registers of a GD350 are read
in the few requests that the planner makes of them. A poll asks without Python in the loop;
its samples are taken and decoded. Figures are medians of the runs, which take turns.

usage: python -m benches.python.monitor [--runs 5] [--seconds 0.5] [--json]
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

from benches.python import programs
from benches.python.figures import markdown, show
from benches.python.masters import UNIT
from benches.python.unpaced import BAUDRATE

import drivebus

RAW, MONITOR, POLL = "bus.read() of the same words", "drive.monitor()", "bus.poll(), each sample decoded"
HEAD = ["what", "registers in requests", "a second", "processor time of each", "beyond the raw reads"]


class Run(NamedTuple):
    """One kind of reading in one run, in seconds for each."""

    wall: float
    cpu: float


def timed(work: Callable[[], int], seconds: float) -> Run:
    """Calls *work*, which says how often it did its work, for so long."""
    for _ in range(20):
        work()
    count, cpu = 0, time.process_time()
    now = start = time.perf_counter()
    while now - start < seconds:
        count += work()
        now = time.perf_counter()
    return Run((now - start) / count, (time.process_time() - cpu) / count)


def taken(poll: drivebus.Poll) -> Callable[[], int]:
    """Takes the samples that have come, and decodes them."""
    return lambda: sum(1 for sample in poll.batch() if dict(sample))


def measure(runs: int, seconds: float) -> tuple[int, int, dict[str, list[Run]]]:
    """How many registers in how many requests, and all runs of each way to read them."""
    with (
        programs.beside("awake"),
        programs.beside("slave") as port,
        drivebus.Bus(port, baudrate=BAUDRATE, parity="N", stopbits=2, silence=0.0) as bus,
    ):
        drive = bus.drive(UNIT, "gd350")
        names = list(drive.monitor())
        reads = drivebus.Profile.builtin("gd350")._native.compile(names).reads

        def raw() -> int:
            for address, count in reads:
                bus.read(UNIT, address, count)
            return 1

        def monitor() -> int:
            return len(drive.monitor()) // len(names)

        measured: dict[str, list[Run]] = {RAW: [], MONITOR: [], POLL: []}
        for _ in range(runs):
            measured[RAW].append(timed(raw, seconds))
            measured[MONITOR].append(timed(monitor, seconds))
            with bus.poll({drive: None}) as poll:
                measured[POLL].append(timed(taken(poll), seconds))
        return len(names), len(reads), measured


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--runs", type=int, default=5)
    options.add_argument("--seconds", type=float, default=0.5, help="of each run")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    registers, requests, measured = measure(given.runs, given.seconds)
    figures: dict[str, object] = {"registers": registers, "requests": requests}
    rows = []
    for kind, runs in measured.items():
        wall, cpu = (statistics.median(times) for times in zip(*runs, strict=True))
        beyond = statistics.median(run.cpu - raw.cpu for run, raw in zip(runs, measured[RAW], strict=True))
        figures[kind] = {"wall": wall, "cpu": cpu, "beyond": beyond}
        extra = "" if kind == RAW else f"{1e6 * beyond:.1f} µs"
        rows.append([kind, f"{registers} in {requests}", f"{1 / wall:.0f}", f"{1e6 * cpu:.1f} µs", extra])
    show(given.json, figures, markdown(HEAD, rows))


if __name__ == "__main__":
    main()
