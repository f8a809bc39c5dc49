"""The program that has the port forks, and is killed; its child lives on. Whose motor runs through it can stop it.

Real processes, and a slave that keeps its own motor.
"""

from __future__ import annotations

import ctypes
import os
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from .own_motor import OwnMotor, own_motor

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="nobody forks here")

BUS = 'import os, sys, drivebus\nbus = drivebus.Bus(sys.argv[1], parity="N", timeout=float(sys.argv[2]))\n'

HANDS_DOWN = {
    "os.fork": "child = os.fork()\nif not child:\n    signal.pause()\n",
    "a child of a child": "child = os.fork()\nif not child:\n    child = os.fork()\n    signal.pause()\n",
    "multiprocessing": (
        "import multiprocessing\n"
        'worker = multiprocessing.get_context("fork").Process(target=signal.pause)\n'
        "worker.start()\nchild = worker.pid\n"
    ),
    # Python is not told of this one.
    "fork of C": "import ctypes\nlibc = ctypes.CDLL(None)\nchild = libc.fork()\nif not child:\n    libc.pause()\n",
    "a program": (
        "import subprocess\n"
        'worker = subprocess.Popen([sys.executable, "-c", "import signal; signal.pause()"], close_fds=False)\n'
        "child = worker.pid\n"
    ),
}
OWNER = """
import signal
print("open", flush=True)
sys.stdin.readline()
{forks}
print(child, flush=True)
signal.pause()
"""
GUEST = """
with bus.drive(1, "gd350").running(hz=10.0):
    print("running", flush=True)
    sys.stdin.readline()
print("stopped", flush=True)
"""


class Child:
    """A program that says a line at a time, and goes on when it is told to."""

    def __init__(self, text: str, port: str, timeout: float) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", BUS + text, port, str(timeout)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def says(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def has_said_more(self) -> bool:
        return bool(select.select([self.process.stdout.fileno() if self.process.stdout else -1], [], [], 0.0)[0])

    def goes_on(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def ends(self) -> tuple[int, str, str]:
        out, said = self.process.communicate(timeout=60)
        return self.process.returncode, out.strip(), said


@contextmanager
def program(text: str, port: str, timeout: float = 0.3) -> Iterator[Child]:
    child = Child(text, port, timeout)
    try:
        yield child
    finally:
        # With all that it forked.
        with suppress(ProcessLookupError):
            os.killpg(child.process.pid, signal.SIGKILL)
        child.process.communicate()


def command(port: str, *what: str) -> subprocess.CompletedProcess[str]:
    base = [sys.executable, "-m", "drivebus", "--port", port, "--format", "8N1"]
    return subprocess.run([*base, *what], capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture
def motor() -> Iterator[OwnMotor]:
    with own_motor() as slave:
        yield slave


@pytest.mark.parametrize("forked_first", [True, False], ids=["before a guest", "after a guest"])
@pytest.mark.parametrize("how", HANDS_DOWN)
def test_a_guest_stops_its_motor_whoever_has_the_descriptors(motor: OwnMotor, how: str, forked_first: bool) -> None:
    with program(OWNER.format(forks=HANDS_DOWN[how]), motor.port) as owner:
        assert owner.says() == "open"
        if forked_first:
            owner.goes_on()
            child = int(owner.says())
        with program(GUEST, motor.port) as guest:
            assert guest.says() == "running"
            if not forked_first:
                owner.goes_on()
                child = int(owner.says())
            motor.until(lambda event: event.get("turns") == 1)
            owner.process.kill()
            owner.process.wait()
            killed = len(motor.events)
            guest.goes_on()
            assert guest.ends() == (0, "stopped", "")
            motor.is_halted(since=killed)
            os.kill(child, 0)  # it lives
        done = command(motor.port, "--profile", "gd350", "stop")
        assert done.returncode == 0, done.stderr
        assert not motor.turns


def test_the_command_stops_the_motor_of_a_program_that_was_killed(motor: OwnMotor) -> None:
    runs = "import signal\nbus.drive(1, 'gd350').run(hz=10.0)\n" + OWNER.format(forks=HANDS_DOWN["os.fork"])
    with program(runs, motor.port) as owner:
        assert owner.says() == "open"
        owner.goes_on()
        child = int(owner.says())
        motor.until(lambda event: event.get("turns") == 1)
        owner.process.kill()
        owner.process.wait()
        killed = len(motor.events)
        done = command(motor.port, "--profile", "gd350", "stop")
        os.kill(child, 0)
        assert done.returncode == 0, done.stderr
        motor.is_halted(since=killed)


def test_a_child_takes_nothing_from_its_parent(motor: OwnMotor) -> None:
    """Its end, and its closing of everything, leave the parent the port, the lock and the guest."""
    forks = HANDS_DOWN["os.fork"].replace("signal.pause()", "bus.close(); del bus; sys.exit(0)")
    owner_text = OWNER.format(forks=forks + "os.waitpid(child, 0)").replace(
        "signal.pause()\n", "sys.stdin.readline()\nprint(bus.read(1, 0x2103))\n"
    )
    with program(owner_text, motor.port) as owner:
        assert owner.says() == "open"
        with program(GUEST, motor.port) as guest:
            assert guest.says() == "running"
            owner.goes_on()
            int(owner.says())
            guest.goes_on()
            assert guest.ends() == (0, "stopped", "")
        with program("", motor.port) as third:
            assert third.ends() == (0, "", "")  # it comes in through the parent
        owner.goes_on()
        assert owner.says() == "[416]"


SILENT_UNIT = """
import ctypes
print("open", flush=True)
sys.stdin.readline()
child = ctypes.CDLL(None)._Fork()  # nobody is told of this one
if not child:
    ctypes.CDLL(None).pause()
print(child, flush=True)
ctypes.CDLL(None).pause()
"""
ASKS = """
print("asking", flush=True)
try:
    bus.read(9, 0x2100)
except drivebus.PortError as error:
    print(error, flush=True)
"""


@pytest.mark.skipif(
    sys.platform != "linux" or not hasattr(ctypes.CDLL(None), "_Fork"), reason="glibc has it since 2.34"
)
def test_a_call_under_way_ends_with_the_owner_whoever_has_its_connection(motor: OwnMotor) -> None:
    """A fork behind the back of the library keeps it all, the lock too. The guest is told at once, and of whom."""
    with program(SILENT_UNIT, motor.port) as owner:
        assert owner.says() == "open"
        with program(ASKS, motor.port, timeout=3600) as guest:
            assert guest.says() == "asking"
            motor.until(lambda event: event.get("unit") == 9)
            owner.goes_on()
            child = int(owner.says())
            owner.process.kill()
            owner.process.wait()
            code, said, _ = guest.ends()
            assert code == 0
            assert f"process {child}" in said
