"""Measures how soon a polling program reads right values again after its adapter was unplugged and put back.

A simulated drive behind a pseudo-terminal is pulled out of a running poll and put back under another name, again and
again, for longer each time so that every step of the back-off is met. Two times are taken for each: from the pull to
the error, and from the return of the port to the first right value. Linux only.

    python tools/measure_replug.py [--rounds 20] [--baudrate 115200]
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

from drivebus import Bus, PortError, Simulator

IDENTIFICATION, GD350 = 0x2103, 0x01A0
LONGEST = 1.5  # seconds without a port in the last round


class Poll:
    """Reads without a pause in a thread of its own, and notes when a right value and when an error came last."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._moved = threading.Condition()
        self._ending = False
        self.reads = self.wrong = 0
        self.last_right = self.last_error = 0.0
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._ending:
            try:
                words = self._bus.read(1, IDENTIFICATION)
            except PortError:
                words = []
            now = time.monotonic()
            with self._moved:
                if words == [GD350]:
                    self.last_right = now
                elif words:
                    self.wrong += 1
                else:
                    self.last_error = now
                self.reads += 1
                self._moved.notify_all()

    def wait(self, name: str, since: float) -> float:
        """Seconds from *since* to the first *name* after it."""
        with self._moved:
            if not self._moved.wait_for(lambda: getattr(self, name) > since, 60):
                raise SystemExit(f"measure_replug: no {name} within a minute")
            return float(getattr(self, name)) - since

    def end(self) -> None:
        """Ends the thread."""
        self._ending = True
        self._thread.join()


def measure(rounds: int, baudrate: int) -> int:
    """Prints the times; returns how many values were wrong."""
    noticed, recovered = [], []
    with tempfile.TemporaryDirectory(prefix="drivebus-by-id-") as folder:
        os.environ["DRIVEBUS_SERIAL_BY_ID"] = folder
        link = Path(folder) / "usb-Simulated_RS485_A50285BI-if00-port0"
        with (
            Simulator({1: "gd350"}, baudrate=baudrate, link=link) as simulator,
            Bus(simulator.port, baudrate=baudrate) as bus,
        ):
            poll = Poll(bus)
            try:
                for number in range(rounds):
                    poll.wait("last_right", time.monotonic())
                    before, missing, pulled = simulator.port, LONGEST * number / rounds, time.monotonic()
                    simulator.line.unplug()
                    noticed.append(poll.wait("last_error", pulled))
                    time.sleep(missing)
                    simulator.line.replug()
                    recovered.append(poll.wait("last_right", time.monotonic()))
                    print(
                        f"{number + 1:3}  {before} -> {simulator.port}, missing for {missing:5.3f} s: "
                        f"noticed in {1e3 * noticed[-1]:5.1f} ms, recovered in {1e3 * recovered[-1]:5.1f} ms"
                    )
            finally:
                poll.end()
            reconnects = bus.stats()["reconnects"]
    for what, times in (("noticed", noticed), ("recovered", recovered)):
        print(f"{what}: median {1e3 * statistics.median(times):.1f} ms, max {1e3 * max(times):.1f} ms")
    print(f"{poll.reads} reads, {reconnects} times opened again, {poll.wrong} wrong values")
    return poll.wrong


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--baudrate", type=int, default=115200)
    given = parser.parse_args()
    return 1 if measure(given.rounds, given.baudrate) else 0


if __name__ == "__main__":
    sys.exit(main())
