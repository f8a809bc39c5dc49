"""Every row of docs/developers/ends.md at a drive that refuses to be halted at first: no motor is left running.

Each exception from 01H to 0BH, for 0.02 to 5 s, which is within the ten seconds for which a halt is sent. Whose program
stops the motor has its drive in its own process and in virtual time; what is left to another program is on a
pseudo-terminal, with a drive in a process of its own (`workshop`). `make test` runs a sample, `DRIVEBUS_MATRIX=all`
runs them all.
"""

from __future__ import annotations

import itertools
import json
import os
import subprocess
import sys

import pytest

from .beside import ROLES, end, goes_on, in_its_place, unguarded
from .endings import AWAITED_ENDINGS, ENDINGS
from .ends import PRELUDE
from .workshop import Workshop

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="nobody forks, and no signal but kill"),
    pytest.mark.usefixtures("folder"),
]

ALL = os.environ.get("DRIVEBUS_MATRIX") == "all"
REFUSALS = [*itertools.product(range(0x01, 0x0C), (0.02, 0.5, 2.0, 5.0))]
STOPPED_BY_ITSELF = [ending for ending in (*ENDINGS, *AWAITED_ENDINGS) if not ending.watchdog]
GONE = [ending for ending in ENDINGS if ending.watchdog]

FORKED = (
    """
import atexit, json, os, sys
refusals, signals = json.loads(sys.argv[1])

def tell():
    if os.getpid() != process:  # a child of it
        return
    simulator.advance(100.0)
    print(exception, seconds, simulator.drive(1).state, flush=True)

# First of all, so that it is called last.
atexit.register(tell)
"""
    + PRELUDE
    + """
for exception, seconds in refusals:
    child = os.fork()
    if not child:
        break
    status = os.waitpid(child, 0)[1]
    print(os.waitstatus_to_exitcode(status), flush=True)
else:
    os._exit(0)

process = os.getpid()
simulator = drivebus.Simulator({1: "gd350"}, transport="process", clock="virtual")
with drivebus.Bus(simulator) as bus:
    bus.drive(1).prepare_control()

def open_bus(face=drivebus.Bus, **keywords):
    return face(simulator, **keywords)

def say(word):
    simulator.drive(1).refuse(exception, asked="writes", seconds=seconds)
    def end(numbers):
        for number in numbers:
            os.kill(os.getpid(), number)
    threading.Thread(target=end, args=(signals[2:],)).start()
    # Here, so that each comes while the program runs: before a loop waits, it would be heard when that is over.
    end(signals[:2])
"""
)
"""A process for each refusal, forked from one that has loaded everything: its body follows."""


@pytest.mark.parametrize("row", range(len(STOPPED_BY_ITSELF)), ids=[ending.name for ending in STOPPED_BY_ITSELF])
def test_a_program_that_ends_stops_its_motor_all_the_same(row: int) -> None:
    ending = STOPPED_BY_ITSELF[row]
    refusals = REFUSALS if ALL else REFUSALS[row % 22 :: 22]
    given = json.dumps([refusals, ending.signals])
    done = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORKED + ending.body, given],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    told = [f"{exception} {seconds} stopped" for exception, seconds in refusals]
    assert done.stdout.splitlines() == [line for each in told for line in (each, f"{ending.code}")], done.stderr


@pytest.mark.parametrize("role", ROLES[1:])
@pytest.mark.parametrize(("exception", "seconds"), REFUSALS if ALL else REFUSALS[:27:9])
def test_who_is_left_halts_it_for_a_program_that_is_gone(exception: int, seconds: float, role: str) -> None:
    ending = GONE[(REFUSALS.index((exception, seconds)) + ROLES.index(role)) % len(GONE)]
    shop = Workshop()
    try:
        with in_its_place(shop, unguarded(ending), role) as (one, beside):
            shop.wait_for(lambda said: said.kind == "runs")
            refuses = shop.tell(f"refuse {exception:02X} {seconds}")
            end(shop, one, ending)
            assert one.child.wait(timeout=60) == ending.code
            stood = shop.wait_for(lambda said: said.kind == "stands")
            assert stood.at - refuses >= seconds, "it had been refused"
            assert beside is not None
            goes_on(beside)
    finally:
        shop.close()
