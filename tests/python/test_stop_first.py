"""A stop goes before all who wait for the line, and so do the reads that confirm it. From the wire's own record."""

from __future__ import annotations

import threading

import drivebus
from drivebus import Bus, Simulator

WAITING = 200
HELD = 2.0
STOP = bytes.fromhex("01 06 20 00 00 05 42 09")
STATE = bytes.fromhex("01 03 21 00")


def requests(simulator: Simulator) -> list[bytes]:
    return [data for _, who, data in simulator.line.trace() if who == "master"]


def test_a_stop_and_its_confirmation_overtake_200_reads_that_wait() -> None:
    with (
        Simulator({1: "gd350"}, transport="process") as simulator,
        Bus(simulator, timeout=2 * HELD) as bus,
    ):
        drive = bus.drive(1)
        drive.prepare_control()
        drive.run(hz=5.0)
        # The same unit: among several they would take turns, and a look at the state need not be urgent.
        other = bus.read(1, 0x2103)
        answers: list[list[int]] = []
        readers = [threading.Thread(target=lambda: answers.append(bus.read(1, 0x2103))) for _ in range(WAITING)]
        # The answer to one read is held back for as long as the others take to queue up behind it, amply.
        simulator.line.delay_answers(HELD)
        begun = simulator.line.requests
        readers[0].start()
        while simulator.line.requests == begun:
            threading.Event().wait(0.001)
        for reader in readers[1:]:
            reader.start()
        sent = len(requests(simulator))
        drive.stop()
        waiting = WAITING - len(answers)
        for reader in readers:
            reader.join()
        seen = requests(simulator)

        assert waiting > WAITING / 4, "reads were still waiting when the stop was confirmed"
        stop = seen.index(STOP)
        assert stop == sent, "the next request after the one in flight"
        # The line is free until this program asks, so others begin. In its turn it would come after all of them.
        assert any(request.startswith(STATE) for request in seen[stop + 1 : stop + WAITING // 2])
        assert answers == [other] * WAITING
        assert drive.wait_until_stopped(30).state is drivebus.State.STOPPED
