"""The end of the program, whatever it is, stops the motor: asked of the simulated drive, by a process of its own.

The simulator runs in this process, the program that drives the motor in another, over a pseudo-terminal. What the drive
was told is in the drive's own log.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import Simulator

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminal, and no signal but kill")

CONTROL, FORWARD, STOP, COAST, JOG, JOG_STOP = 0x2000, 1, 5, 6, 3, 8
CE = 18  # GD350 manual, list of faults: communication fault
KILLED_BY = {signal.SIGTERM: 143, signal.SIGHUP: 129} if os.name != "nt" else {}
RAMP = 0.5  # seconds to 50 Hz

PROGRAM = """
import signal, sys, threading, time, drivebus

def running():
    print("running", flush=True)

with drivebus.Bus(sys.argv[1], timeout=2.0) as bus:
    drive = bus.drive(1)
    {body}
"""
NOT_CLOSED = PROGRAM.replace(
    "with drivebus.Bus(sys.argv[1], timeout=2.0) as bus:", "bus = drivebus.Bus(sys.argv[1], timeout=2.0)\nif bus:"
)

HANG = """
    with drive.running(10.0):
        running()
        bus.sleep(100)
"""


children: list[subprocess.Popen[str]] = []


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "gd350"}) as simulator:
        with drivebus.Bus(simulator) as bus:
            for unit in (1, 2):
                drive = bus.drive(unit)
                drive.prepare_control()
                drive.write({"P00.11": RAMP, "P00.12": RAMP})
        yield simulator
        # What a failed test left behind.
        while children:
            child = children.pop()
            child.kill()
            child.communicate()


def commands(simulator: Simulator, unit: int = 1) -> list[int]:
    return [value for _, address, value in simulator.drive(unit).writes() if address == CONTROL]


def start(simulator: Simulator, body: str, program: str = PROGRAM) -> subprocess.Popen[str]:
    """Starts a program, and returns when it says that the motor runs."""
    text = program.format(body=body.strip())
    child = subprocess.Popen(
        [sys.executable, "-c", text, simulator.port], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    children.append(child)
    assert child.stdout is not None
    # A byte at a time: what was read beyond the line would be lost to `communicate`.
    line = b""
    while not line.endswith(b"\n") and (byte := os.read(child.stdout.fileno(), 1)):
        line += byte
    assert line == b"running\n", (line, child.communicate(timeout=60))
    return child


def end(child: subprocess.Popen[str]) -> tuple[int, str]:
    """Waits for the end of the program; its exit code, and what it said on standard error."""
    _, said = child.communicate(timeout=60)
    return child.returncode, said


@pytest.mark.parametrize("number", KILLED_BY)
def test_a_signal_inside_a_block_stops_the_motor(simulator: Simulator, number: signal.Signals) -> None:
    child = start(simulator, HANG)
    child.send_signal(number)
    assert end(child) == (KILLED_BY[number], "")
    assert commands(simulator) == [FORWARD, STOP]
    assert simulator.drive(1).state in ("forward", "stopped")


def test_a_signal_ends_a_jog(simulator: Simulator) -> None:
    child = start(simulator, HANG.replace("running(10.0)", "jogging()"))
    child.send_signal(signal.SIGTERM)
    assert end(child) == (143, "")
    assert commands(simulator) == [JOG, JOG_STOP]


def test_a_signal_between_two_bytecodes_stops_the_motor(simulator: Simulator) -> None:
    child = start(simulator, HANG.replace("bus.sleep(100)", "while True: pass"))
    child.send_signal(signal.SIGTERM)
    assert end(child) == (143, "")
    assert commands(simulator) == [FORWARD, STOP]


def test_signals_that_come_while_it_stops_wait_until_it_has(simulator: Simulator) -> None:
    body = """
    from drivebus.operations import motion
    end, calls = motion.end_run, []
    async def end_late(unit, within):
        for _ in range(10):
            signal.raise_signal(signal.SIGTERM)
        calls.append(await end(unit, within))
    motion.end_run = end_late
    with drive.running(10.0):
        running()
        try:
            with drive.running(12.0):
                signal.raise_signal(signal.SIGTERM)
        except SystemExit as error:
            print(error.code, len(calls), flush=True)
    """
    child = start(simulator, body)
    out, said = child.communicate(timeout=60)
    assert (child.returncode, out, said) == (143, "143 1\n", "")
    assert commands(simulator) == [FORWARD, FORWARD, STOP, STOP]


@pytest.mark.parametrize(
    ("ending", "code"),
    [
        pytest.param("sys.exit(9)", 9, id="sys.exit"),
        pytest.param("raise RuntimeError('inside')", 1, id="exception"),
        pytest.param("raise KeyboardInterrupt", -signal.SIGINT, id="Ctrl-C"),
    ],
)
def test_leaving_a_block_by_any_way_stops_the_motor(simulator: Simulator, ending: str, code: int) -> None:
    assert end(start(simulator, HANG.replace("bus.sleep(100)", ending)))[0] == code
    assert commands(simulator) == [FORWARD, STOP]


def test_a_daemon_thread_at_the_end_of_the_program(simulator: Simulator) -> None:
    body = """
    begun = threading.Event()
    def work():
        with drive.running(10.0):
            begun.set()
            bus.sleep(100)
    threading.Thread(target=work, daemon=True).start()
    begun.wait()
    running()
    """
    child = start(simulator, body, NOT_CLOSED)
    assert end(child) == (0, "")
    assert commands(simulator) == [FORWARD, STOP]


def test_a_block_that_nobody_left(simulator: Simulator) -> None:
    body = """
    block = drive.running(10.0)
    block.__enter__()
    running()
    """
    child = start(simulator, body, NOT_CLOSED)
    assert end(child) == (0, "")
    assert commands(simulator) == [FORWARD, STOP]


def test_a_signal_stops_what_other_threads_run(simulator: Simulator) -> None:
    body = """
    other, begun = bus.drive(2), threading.Event()
    def work():
        with other.running(10.0):
            begun.set()
            # The block goes on although the program is asked to end: only its motor is stopped.
            other.wait_until_stopped(60)
    thread = threading.Thread(target=work)
    with drive.running(10.0):
        thread.start()
        begun.wait()
        try:
            running()
            bus.sleep(100)
        finally:
            thread.join()
    """
    child = start(simulator, body)
    child.send_signal(signal.SIGTERM)
    assert end(child) == (143, "")
    assert commands(simulator, 1) == [FORWARD, STOP]
    # By the signal; at the end of its block once more, if that came first.
    assert commands(simulator, 2) in ([FORWARD, STOP], [FORWARD, STOP, STOP])


def test_a_handler_of_the_programs_own_stays(simulator: Simulator) -> None:
    body = """
    heard = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: heard.set())
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with drive.running(10.0):
        running()
        while not heard.is_set():
            bus.sleep(0.01)
    assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    """
    child = start(simulator, body)
    child.send_signal(signal.SIGHUP)
    child.send_signal(signal.SIGTERM)
    assert end(child) == (0, "")
    assert commands(simulator) == [FORWARD, STOP]


def test_outside_of_blocks_signals_are_as_they_were(simulator: Simulator) -> None:
    body = """
    before = signal.getsignal(signal.SIGTERM)
    with drive.running(10.0), drive.running(12.0):
        inside = signal.getsignal(signal.SIGTERM)
    print(before == signal.getsignal(signal.SIGTERM) == signal.SIG_DFL != inside)
    """
    out, said = start(simulator, "running()\n" + body).communicate(timeout=60)
    assert (out, said) == ("True\n", "")


def test_a_forked_child_stops_nothing(simulator: Simulator) -> None:
    body = """
    import os
    with drive.running(10.0):
        child = os.fork()
        if not child:
            import atexit
            atexit._run_exitfuncs()
            os._exit(0)
        os.waitpid(child, 0)
        running()
        print(sys.stdin.readline())
    """
    text = PROGRAM.format(body=body.strip())
    child = subprocess.Popen(
        [sys.executable, "-W", "ignore", "-c", text, simulator.port],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    children.append(child)
    assert child.stdout is not None
    assert child.stdout.readline() == "running\n"
    assert commands(simulator) == [FORWARD]
    child.communicate("\n", timeout=60)
    assert commands(simulator) == [FORWARD, STOP]


def test_what_other_threads_run_is_stopped_before_the_line_is_closed(simulator: Simulator) -> None:
    body = """
    other, begun, ended = bus.drive(2), threading.Event(), threading.Event()
    stop = other.stop
    def stop_late():
        # As late as it can be: the main thread has stopped its own motor, and would close the bus next.
        while drive.state().running:
            pass
        stop()
    other.stop = stop_late
    def work():
        with other.running(10.0):
            begun.set()
            ended.wait()
    threading.Thread(target=work, daemon=True).start()
    begun.wait()
    with drive.running(10.0):
        running()
        bus.sleep(100)
    """
    child = start(simulator, body)
    child.send_signal(signal.SIGTERM)
    assert end(child) == (143, "")
    assert commands(simulator, 2) == [FORWARD, STOP]


def test_a_child_that_is_asked_to_end_as_soon_as_it_is_there_ends(simulator: Simulator) -> None:
    """`multiprocessing` does so at its exit, and then waits for the child, before anything else ends."""
    body = """
    with drive.running(10.0):
        child = os.fork()
        if not child:
            signal.alarm(20)
            while True:
                signal.pause()
        running()
        print(os.WTERMSIG(os.waitpid(child, 0)[1]))
    """
    # The first hook of all: those of drivebus have not run when the signal comes.
    early = "os.register_at_fork(after_in_child=lambda: os.kill(os.getpid(), signal.SIGTERM))"
    child = start(simulator, body, PROGRAM.replace("import signal, sys", f"import os, signal\n{early}\nimport sys", 1))
    out, said = child.communicate(timeout=60)
    assert (child.returncode, out, said) == (0, f"{signal.SIGTERM:d}\n", "")
    assert commands(simulator) == [FORWARD, STOP]


@pytest.mark.parametrize("leave", ["pass", "sys.exit(0)", "raise RuntimeError", "os.kill(os.getpid(), signal.SIGTERM)"])
def test_a_child_that_c_code_forked_leaves_the_motor_to_its_parent(simulator: Simulator, leave: str) -> None:
    """Python runs no hooks for it, and it leaves the block, and the program, all the same."""
    body = f"""
    with drive.running(10.0):
        child = ctypes.CDLL(None).fork()
        if child:
            running()
            os.waitpid(child, 0)
            print(drive.state().name)
        else:
            {leave}
    """
    child = start(simulator, body, PROGRAM.replace("import signal", "import ctypes, os, signal", 1))
    out, said = child.communicate(timeout=60)
    assert (child.returncode, out) == (0, "FORWARD\n"), said
    assert "drivebus" not in said.replace("RuntimeError", "")
    # That it ran behind the child's end tells who stopped it. A drive that is slow to confirm is told again.
    run, *halts = commands(simulator)
    assert run == FORWARD
    assert {STOP} <= {*halts} <= {STOP, COAST}


@pytest.mark.parametrize("action", ["coast", "stop"])
def test_a_killed_program_leaves_the_drive_to_its_watchdog(simulator: Simulator, action: str) -> None:
    body = f"""
    with drive.watchdog(2.0, "{action}", unverified=True), drive.running(10.0):
        running()
        bus.sleep(100)
    """
    child = start(simulator, body)
    drive = simulator.drive(1)
    # For longer than the time-out it keeps the drive from acting.
    told = simulator.now()
    pause = threading.Event()
    while simulator.now() < told + 3.0:
        pause.wait(0.05)
    assert (drive.state, drive.fault) == ("forward", 0)
    child.kill()
    child.wait(timeout=60)
    while drive.state == "forward":  # the limit is this test's own
        pause.wait(0.05)
    assert (drive.state, drive.fault) == (("fault", CE) if action == "coast" else ("stopped", 0))
    assert commands(simulator) == [FORWARD], "nobody told it to stop"
    child.communicate()


def test_a_watchdog_that_nobody_closed_is_left_to_the_drive(simulator: Simulator) -> None:
    body = """
    watchdog = drive.watchdog(3.0, unverified=True)
    drive.run(10.0)
    running()
    """
    assert end(start(simulator, body, NOT_CLOSED)) == (0, "")
    pause = threading.Event()
    while simulator.drive(1).state == "forward":  # the limit is this test's own
        pause.wait(0.05)
    assert simulator.drive(1).fault == CE
    assert commands(simulator) == [FORWARD], "run() outlives the program, as it says"


def test_a_forked_child_leaves_the_line_to_its_parent(simulator: Simulator) -> None:
    body = """
    with drive.watchdog(60.0, unverified=True), drive.running(10.0):
        for leave in (lambda: sys.exit(0), lambda: None):
            child = os.fork()
            if not child:
                try:
                    bus.read(1, 0x2100)
                except drivebus.PortError as error:
                    print("a forked child" in str(error), bus.closed, bus.link(1).asked, flush=True)
                leave()
                break
            os.waitpid(child, 0)
        else:
            running()
            os.kill(os.getpid(), signal.SIGKILL)
    """
    program = PROGRAM.replace("import signal", "import os, signal")
    child = subprocess.run(
        # CPython 3.12 warns of any fork beside threads.
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", program.format(body=body.strip()), simulator.port],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert child.stdout.splitlines() == ["True True 0", "True True 0", "running"]
    assert child.stderr == "", "a child leaves its blocks without a word"
    assert child.returncode == -signal.SIGKILL
    assert commands(simulator) == [FORWARD], "no child sent a stop"
    assert simulator.drive(1).register(0x0E04) == 600, "no child disarmed the watchdog"


def test_a_forked_child_leaves_the_simulator_to_its_parent(tmp_path: Path) -> None:
    program = """
import os, sys, drivebus
with drivebus.Simulator({1: "gd350"}, link=sys.argv[1]) as simulator, drivebus.Bus(simulator) as bus:
    child = os.fork()
    if not child:
        sys.exit(7)
    print(os.waitpid(child, 0)[1] >> 8, bus.read(1, 0x2100), os.path.islink(sys.argv[1]))
"""
    child = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "drive")],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (child.stdout, child.returncode) == ("7 [3] True\n", 0), child.stderr


def test_a_forked_child_has_simulators_of_its_own_and_those_of_its_parent_go_on() -> None:
    program = """
import os, drivebus
simulators = [drivebus.Simulator({1: "gd350"}) for _ in range(2)]
buses = [drivebus.Bus(simulator.port) for simulator in simulators]
child = os.fork()
if not child:
    with drivebus.Simulator({1: "gd350"}) as own, drivebus.Bus(own.port) as bus:
        print(bus.read(1, 0x2100), flush=True)
    for simulator in simulators:
        simulator.close()
    os._exit(0)
print(os.waitpid(child, 0)[1], [bus.read(1, 0x2100) for bus in buses])
"""
    child = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (child.stdout, child.returncode) == ("[3]\n0 [[3], [3]]\n", 0), child.stderr
