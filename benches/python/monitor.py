"""What reading a drive by names costs beyond the line: processor time of `drive.monitor()` and of the same raw reads.

At the other end is the slave in C that answers at once (see `unpaced`); all 23 monitor registers of a GD350 are read
in the few requests that the planner makes of them. Figures are medians of the runs, which take turns.

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

HEAD = ["what", "requests each", "a second", "processor time of each", "beyond the raw reads"]


class Run(NamedTuple):
    """One kind of reading in one run, in seconds for each."""

    wall: float
    cpu: float


def timed(work: Callable[[], object], seconds: float) -> Run:
    """Calls *work* for so long."""
    for _ in range(20):
        work()
    count, cpu = 0, time.process_time()
    now = start = time.perf_counter()
    while now - start < seconds:
        work()
        count += 1
        now = time.perf_counter()
    return Run((now - start) / count, (time.process_time() - cpu) / count)


def main() -> None:
    """The command."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--runs", type=int, default=5)
    options.add_argument("--seconds", type=float, default=0.5, help="of each run")
    options.add_argument("--json", action="store_true", help="figures instead of a table")
    given = options.parse_args()
    with (
        programs.beside("awake"),
        programs.beside("slave") as port,
        drivebus.Bus(port, baudrate=BAUDRATE, parity="N", stopbits=2, silence=0.0) as bus,
    ):
        drive = bus.drive(UNIT, "gd350")
        names = list(drive.monitor())
        asked = bus.stats().requests
        drive.monitor()
        requests = bus.stats().requests - asked
        reads = drivebus.Profile.builtin("gd350")._native.compile(names).reads

        def raw() -> None:
            for address, count in reads:
                bus.read(UNIT, address, count)

        kinds: dict[str, Callable[[], object]] = {"raw reads": raw, "drive.monitor()": drive.monitor}
        runs: dict[str, list[Run]] = {kind: [] for kind in kinds}
        for _ in range(given.runs):
            for kind, work in kinds.items():
                runs[kind].append(timed(work, given.seconds))
    beyond = statistics.median(
        monitor.cpu - raw.cpu for monitor, raw in zip(runs["drive.monitor()"], runs["raw reads"], strict=True)
    )
    figures: dict[str, object] = {"registers": len(names), "requests": requests, "beyond": beyond}
    rows = []
    for kind, all_runs in runs.items():
        wall = statistics.median(run.wall for run in all_runs)
        cpu = statistics.median(run.cpu for run in all_runs)
        figures[kind] = {"wall": wall, "cpu": cpu}
        extra = f"{1e6 * beyond:.1f} µs" if kind != "raw reads" else ""
        rows.append([kind, str(requests), f"{1 / wall:.0f}", f"{1e6 * cpu:.1f} µs", extra])
    show(given.json, figures, markdown(HEAD, rows))


if __name__ == "__main__":
    main()
