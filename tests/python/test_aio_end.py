"""The end of a program with an event loop, whatever it is, stops the motor: asked of the simulated drive.

The simulator runs in this process, the program that drives the motor in another, over a pseudo-terminal.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

import drivebus
from drivebus import Simulator

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal, and no signal but kill")

CONTROL, FORWARD, STOP = 0x2000, 1, 5
LOOPS = {
    "asyncio": "asyncio.run(main())",
    "bare": "asyncio.new_event_loop().run_until_complete(main())",
    "uvloop": "import uvloop; uvloop.run(main())",
}
if importlib.util.find_spec("uvloop") is None:
    del LOOPS["uvloop"]

PROGRAM = """
import asyncio, os, signal, sys, drivebus.aio

async def main():
    bus = await drivebus.aio.Bus(sys.argv[1], timeout=2.0)
    drive = await bus.drive(1)
    async with drive.running(10.0):
        print("running", flush=True)
        {inside}
{run}
"""


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350"}) as simulator:
        with drivebus.Bus(simulator) as bus:
            drive = bus.drive(1)
            drive.prepare_control()
            drive.write({"P00.11": 0.5, "P00.12": 0.5})
        yield simulator


def run(simulator: Simulator, inside: str, loop: str) -> subprocess.CompletedProcess[str]:
    """Runs the program to its end."""
    program = PROGRAM.format(inside=inside, run=LOOPS[loop])
    return subprocess.run(
        [sys.executable, "-c", program, simulator.port], capture_output=True, text=True, timeout=100, check=False
    )


def commands(simulator: Simulator) -> list[int]:
    """What it was told; a stop that was answered late, as on a busy machine, goes out again and counts once."""
    told = [value for _, address, value in simulator.drive(1).writes() if address == CONTROL]
    return [command for command, _ in itertools.groupby(told)]


ENDS = {
    "SIGTERM while it waits": ("os.kill(os.getpid(), signal.SIGTERM); await asyncio.sleep(60)", 143),
    "SIGTERM later": (
        "asyncio.get_running_loop().call_later(0.1, os.kill, os.getpid(), signal.SIGTERM); await asyncio.sleep(60)",
        143,
    ),
    "Ctrl-C": ("os.kill(os.getpid(), signal.SIGINT); await asyncio.sleep(60)", -signal.SIGINT),
    "an error": ("raise RuntimeError", 1),
    "sys.exit": ("sys.exit(9)", 9),
    "the loop stops": ("asyncio.get_running_loop().stop(); await asyncio.sleep(60)", 1),
}


@pytest.mark.parametrize(
    ("end", "loop"),
    [(end, loop) for end in ENDS for loop in LOOPS if loop == "asyncio" or end in ("SIGTERM later", "the loop stops")],
)
def test_the_motor_is_stopped(simulator: Simulator, end: str, loop: str) -> None:
    inside, code = ENDS[end]
    done = run(simulator, inside, loop)
    assert done.stdout == "running\n"
    assert done.returncode == code, done.stderr
    assert commands(simulator) == [FORWARD, STOP], done.stderr
    assert simulator.drive(1).state in ("forward", "stopped")


def test_ctrl_c_again_while_it_stops_leaves_no_motor_running(simulator: Simulator) -> None:
    inside = """
        def again():
            os.kill(os.getpid(), signal.SIGINT)
        for number in range(1, 6):
            asyncio.get_running_loop().call_later(0.005 * number, again)
        await asyncio.sleep(60)
    """.strip()
    done = run(simulator, inside, "asyncio")
    assert done.returncode == -signal.SIGINT
    assert commands(simulator)[:2] == [FORWARD, STOP]


@pytest.mark.parametrize("loop", LOOPS)
def test_a_signal_that_does_not_wake_the_loop_is_heard_all_the_same(simulator: Simulator, loop: str) -> None:
    """It came just before the loop began to wait, or to another thread. Nothing else wakes this one."""
    inside = """
        import subprocess, threading, time
        threading.Thread(target=time.sleep, args=(1000,), daemon=True).start()
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
        sending = "import os, signal, sys; os.kill(int(sys.argv[1]), signal.SIGTERM)"
        subprocess.Popen([sys.executable, "-c", sending, str(os.getpid())])
        await asyncio.Event().wait()
"""
    ended = run(simulator, inside.strip(), loop)
    assert ended.returncode == 128 + signal.SIGTERM, ended.stderr
    assert commands(simulator) == [FORWARD, STOP]
