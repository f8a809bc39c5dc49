"""Ctrl-C during any wait: it comes through at once, and the port can be used afterwards.

A process of its own is interrupted, because that is what a person does.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a whole console")

PROGRAM = """
import sys, time, drivebus

waits = {{
    "read": lambda bus: bus.read(9, 0x2100),
    "sleep": lambda bus: bus.sleep(60),
    "scan": lambda bus: list(bus.scan(timeout=30)),
    "speed": lambda bus: bus.drive(1).wait_for_speed(50.0, timeout=60),
}}
with drivebus.Simulator({{1: "gd350"}}, transport="{transport}") as simulator:
    with drivebus.Bus(simulator, timeout=60, retries=0) as bus:
        bus.read(1, 0x2103)
        print("waiting", flush=True)
        try:
            waits["{wait}"](bus)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        print(bus.read(1, 0x2103), flush=True)
"""


@pytest.mark.parametrize("transport", ["process", "pty", "tcp"])
@pytest.mark.parametrize("wait", ["read", "sleep", "scan", "speed"])
def test_ctrl_c_ends_a_wait_and_leaves_the_port_usable(transport: str, wait: str) -> None:
    program = PROGRAM.format(transport=transport, wait=wait)
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "waiting\n"
        child.send_signal(signal.SIGINT)
        # The wait itself would last 30 s or more; the time-out only ends a test that has failed.
        output, _ = child.communicate(timeout=20)
    assert output.splitlines() == ["interrupted", "[416]"]
    assert child.returncode == 0
