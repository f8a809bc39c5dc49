"""What recording costs, and what a kill costs a recording: the figures of docs/record.md.

    python -m tools.measure_recording long --seconds 600     eight drives, 23 registers each, as fast as the line
    python -m tools.measure_recording kills --times 20       a kill -9 at a random moment, in turn for each format

`long` polls the same drives alone before and after, so that the shares of the wire stand side by side. `kills` compares
each file with a capture that the killed program wrote frame by frame.
"""

from __future__ import annotations

import argparse
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import drivebus
from drivebus.capture import read as captured
from drivebus.record import read

FORMATS = ("csv", "jsonl", "sqlite", "parquet")
UNITS = range(1, 9)


@contextmanager
def simulated(folder: Path) -> Iterator[str]:
    """Eight drives behind a pseudo-terminal, in a process of their own."""
    link = folder / "line"
    units = ",".join(f"{unit}=gd350" for unit in UNITS)
    words = [sys.executable, "-m", "drivebus", "sim", "--units", units, "--link", str(link)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as process:
        while not link.exists():
            time.sleep(0.05)
        try:
            yield str(link)
        finally:
            process.terminate()


def resident() -> int:
    """KiB of memory that this process has now."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def alone(drives: dict[drivebus.Drive, list[str]], bus: drivebus.Bus, seconds: float) -> float:
    """Samples a second of a poll that nobody writes down."""
    with bus.poll(drives) as poll:
        poll.batch(1)
        began, count = bus.now(), 0
        while bus.now() - began < seconds:
            count += len(poll.batch(timeout=0.2))
        return count / (bus.now() - began)


def long(seconds: float, formats: Sequence[str]) -> None:
    """Records for *seconds* in each of *formats* in turn, and prints what it cost."""
    with tempfile.TemporaryDirectory() as name, simulated(Path(name)) as port, drivebus.Bus(port) as bus:
        drives = {bus.drive(unit, "gd350"): None for unit in UNITS}
        asked = {
            drive: [*(name for name in drive.readable() if "identification" not in name), "status_word_1", "fault_code"]
            for drive in drives
        }
        before = alone(asked, bus, 30.0)
        for ending in formats:
            path = Path(name) / f"run.{ending}"
            began, sizes = bus.now(), []
            with drivebus.Recorder(path, drives) as recorder:
                while bus.now() - began < seconds / len(formats):
                    recorder.wait(5.0)
                    sizes.append(resident())
                took, rows = bus.now() - began, recorder.rows
            found = read(path)
            print(
                f"{ending}: {took:.0f} s, {rows} rows, {rows / took:.2f}/s beside {before:.2f}/s alone "
                f"({rows / took / before:.1%}), {recorder.gaps} gaps, {recorder.missing} missing, "
                f"{recorder.lost} lost, "
                f"memory {sizes[1] / 1024:.1f} to {sizes[-1] / 1024:.1f} MiB (most {max(sizes) / 1024:.1f}), "
                f"{path.stat().st_size / 1e6:.1f} MB, read back {sum(map(len, found.times.values()))}",
                flush=True,
            )
            for event in found.events:
                if event.kind == "gap":
                    print(f"    gap of {event.drive} after {event.time - found.events[0].time:.1f} s: {event.text}")
            del found
        print(f"alone, afterwards: {alone(asked, bus, 30.0):.2f}/s")


def kills(times: int, seed: int) -> None:
    """Kills a recording at random moments, and prints what was lost."""
    chance = random.Random(seed)
    losses: list[float] = []
    for number in range(times):
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / f"run.{FORMATS[number % len(FORMATS)]}"
            wire = Path(name) / "wire.pcapng"
            words = ["--port", "sim://gd350", "--capture", str(wire), "record", str(path)]
            with subprocess.Popen([sys.executable, "-m", "drivebus", *words], stderr=subprocess.DEVNULL) as process:
                while not wire.exists() or wire.stat().st_size < 5000:
                    time.sleep(0.01)
                time.sleep(chance.uniform(0.0, 4.0))
                process.kill()
            last = max(frame.time or 0.0 for frame in captured(wire) if frame.asks is False)
            found = read(path)
            ends = found.times.get("unit 1", [])
            losses.append(last - (ends[-1] if ends else found.events[0].time))
            print(f"{path.suffix}: {len(ends)} rows, {losses[-1] * 1e3:.0f} ms lost", flush=True)
    print(f"{times} kills: median {statistics.median(losses) * 1e3:.0f} ms, at most {max(losses) * 1e3:.0f} ms lost")


def main() -> None:
    """Measures what is asked for."""
    parser = argparse.ArgumentParser(description="what recording costs, and what a kill costs it")
    kinds = parser.add_subparsers(dest="kind", required=True)
    lasting = kinds.add_parser("long")
    lasting.add_argument("--seconds", type=float, default=600.0, help="in all")
    lasting.add_argument("--formats", default=",".join(FORMATS))
    killed = kinds.add_parser("kills")
    killed.add_argument("--times", type=int, default=20)
    killed.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if given.kind == "long":
        long(given.seconds, given.formats.split(","))
    else:
        kills(given.times, given.seed)


if __name__ == "__main__":
    main()
