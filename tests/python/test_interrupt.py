"""Ctrl-C during any wait: it comes through at once, and the port can be used afterwards.

A process of its own is interrupted, because that is what a person does.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a whole console")

PROGRAM = """
import os, signal, threading, drivebus

waits = {{
    "read": lambda bus: bus.read(9, 0x2100),
    "sleep": lambda bus: bus.sleep(60),
    "scan": lambda bus: list(bus.scan(timeout=30)),
    "speed": lambda bus: bus.drive(1).wait_for_speed(50.0, timeout=60),
}}
with drivebus.Simulator({{1: "gd350"}}, transport="{transport}") as simulator:
    with drivebus.Bus(simulator, timeout=60, retries=0) as bus:
        bus.read(1, 0x2103)
        before = simulator.line.requests

        def interrupt():
            # Once the wait has sent something it has begun; one that sends nothing may be met at its beginning.
            while "{wait}" != "sleep" and simulator.line.requests == before:
                pass
            os.kill(os.getpid(), signal.SIGINT)

        try:
            threading.Thread(target=interrupt).start()
            waits["{wait}"](bus)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        print(bus.read(1, 0x2103), flush=True)
"""


@pytest.mark.parametrize("transport", ["process", "pty", "tcp"])
@pytest.mark.parametrize("wait", ["read", "sleep", "scan", "speed"])
def test_ctrl_c_ends_a_wait_and_leaves_the_port_usable(transport: str, wait: str) -> None:
    program = PROGRAM.format(transport=transport, wait=wait)
    # The wait itself would last 30 s or more; the time-out only ends a test that has failed.
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=False)
    assert done.stdout.splitlines() == ["interrupted", "[416]"], done.stderr
    assert done.returncode == 0


SHORT = """
import os, signal, threading, time, drivebus

with drivebus.Simulator({1: "gd350"}) as simulator, drivebus.Bus(simulator, timeout=0.04, retries=100) as bus:
    for ask in (lambda: bus.echo(1), lambda: bus.read(1, 0x2103)):
        while True:  # on a busy machine 40 ms are little
            try:
                ask()
                break
            except drivebus.NoAnswer:
                pass
    simulator.line.drop_answers(1000)
    before = bus.stats().retries

    def interrupt():
        while bus.stats().retries < before + 5:
            time.sleep(0.001)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    try:
        bus.read(1, 0x2103)
    except (KeyboardInterrupt, drivebus.NoAnswer) as error:
        print(type(error).__name__, bus.stats().retries < before + 50)
"""


def test_ctrl_c_is_heard_between_attempts_that_are_short() -> None:
    done = subprocess.run([sys.executable, "-c", SHORT], capture_output=True, text=True, timeout=100, check=False)
    assert done.stdout.splitlines() == ["KeyboardInterrupt True"], done.stderr
