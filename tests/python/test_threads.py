"""Many threads on one bus: whoever asks gets the answer to what it asked, on a good line and on a bad one.

In virtual time, so that thousands of reads take seconds. What stands in each register is asked of the drive itself, not
of the bus.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable

import pytest

import drivebus
from drivebus import Bus, Simulator

THREADS = 8
READS = 1000
# That a unit answers with as many words as it was asked for is assumed where answers come late
# (docs/developers/architecture.md).
BAD_LINE = {"all": 0.02, "short": 0.0, "long": 0.0}
BAD_UNIT = {"all": 0.02, "late": 0.0, "overtaken": 0.0}
# P00.10 to P00.12 and P01.20, in both units: answers of one length, of which only the value tells one from another.
PLACES = [(unit, address) for unit in (1, 2) for address in (0x000A, 0x000B, 0x000C, 0x0114)]


def in_threads(work: Callable[[int], None]) -> None:
    """Calls *work* with 0..THREADS - 1, all at once, and waits for the end of all."""
    begin = threading.Barrier(THREADS)

    def run(index: int) -> None:
        begin.wait()
        work(index)

    threads = [threading.Thread(target=run, args=(index,)) for index in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


@pytest.mark.parametrize("faults", [{}, BAD_LINE, BAD_UNIT], ids=["good line", "bad line", "bad unit"])
def test_no_thread_gets_the_answer_of_another(faults: dict[str, float]) -> None:
    with (
        Simulator({1: "gd350", 2: "gd350"}, transport="process", clock="virtual", seed=7) as simulator,
        Bus(simulator) as bus,
    ):
        for number, (unit, address) in enumerate(PLACES):
            bus.write(unit, 0x8000 | address, 100 + number)  # to RAM
        expected = [simulator.drive(unit).register(address) for unit, address in PLACES]
        assert len(set(expected)) == THREADS
        simulator.line.set_faults(**faults)
        outcomes: list[Counter[str]] = [Counter() for _ in range(THREADS)]

        def ask(index: int) -> None:
            unit, address = PLACES[index]
            for _ in range(READS):
                try:
                    [word] = bus.read(unit, address)
                except drivebus.DrivebusError as error:
                    outcomes[index][type(error).__name__] += 1
                else:
                    outcomes[index]["right" if word == expected[index] else "wrong"] += 1

        in_threads(ask)
        assert [sum(each.values()) for each in outcomes] == [READS] * THREADS
        total = sum(outcomes, Counter())
        assert total["wrong"] == 0
        # Of sixteen kinds of fault, 2 % each, the longest keeps an answer for more than all time-outs of a call.
        assert total["right"] >= (0.98 if faults else 1) * READS * THREADS
