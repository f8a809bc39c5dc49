"""Ctrl-Z holds a command that has the port: it gives the port up first, so that others stop the motor through nobody.

Real processes, and a slave that keeps its own motor.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import drivebus
from drivebus import Bus, NotAllowed, Simulator

from .own_motor import OwnMotor, own_motor
from .test_forked_owner import command

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="no Ctrl-Z that holds a program"),
    pytest.mark.usefixtures("folder"),
]


@pytest.fixture
def motor() -> Iterator[OwnMotor]:
    with own_motor() as slave:
        yield slave


@contextmanager
def monitor(port: str) -> Iterator[subprocess.Popen[str]]:
    """A command that has the port, once it has shown something."""
    base = [sys.executable, "-m", "drivebus", "--port", port, "--format", "8N1", "--profile", "gd350", "--json"]
    child = subprocess.Popen([*base, "monitor", "--interval", "0.05"], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    try:
        assert child.stdout.readline()
        yield child
    finally:
        child.kill()
        child.communicate()


def hold(child: subprocess.Popen[str]) -> None:
    child.send_signal(signal.SIGTSTP)
    os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOWAIT)


def test_a_stop_goes_out_while_who_had_the_port_is_held(motor: OwnMotor) -> None:
    with monitor(motor.port) as first:
        done = command(motor.port, "--profile", "gd350", "run", "10", "--yes")
        assert done.returncode == 0, done.stderr
        hold(first)
        before = len(motor.events)
        done = command(motor.port, "--profile", "gd350", "stop")
        assert done.returncode == 0, done.stderr
        motor.is_halted(since=before)
        assert not motor.turns


def test_it_goes_on_afterwards_and_beside_who_has_the_port_by_then(motor: OwnMotor) -> None:
    with monitor(motor.port) as first:
        assert first.stdout is not None
        hold(first)
        with Bus(motor.port, parity="N") as bus:
            bus.read(1, 0x2103)
            first.send_signal(signal.SIGCONT)
            # What it had said before fills no pipe: these come from after.
            for _ in range(40):
                assert first.stdout.readline()
                bus.read(1, 0x2103)
            assert [each["here"] for each in bus.stats()["programs"]] == [True]
        first.send_signal(signal.SIGINT)
        assert first.wait(timeout=30) in (0, 130, -signal.SIGINT)


def test_a_guest_that_is_held_holds_up_nobody(motor: OwnMotor) -> None:
    with Bus(motor.port, parity="N") as bus, monitor(motor.port) as guest:
        hold(guest)
        for _ in range(20):
            bus.read(1, 0x2103)
        bus.drive(1, "gd350").stop()


class TestStepAside:
    """What the commands do, for programs of one's own."""

    def test_another_one_opens_the_port_meanwhile(self) -> None:
        with Simulator({1: "gd350"}, transport="pty") as simulator, Bus(simulator.port, share="never") as bus:
            with pytest.raises(drivebus.PortError, match="has it open already"):
                Bus(simulator.port, share="never")
            asked: list[list[int]] = []

            def meanwhile() -> None:
                with Bus(simulator.port, share="never") as other:
                    asked.append(other.read(1, 0x2103))

            bus.step_aside(meanwhile)
            assert asked == [bus.read(1, 0x2103)]
            assert bus.reconnects == 1

    def test_what_is_raised_meanwhile_comes_out(self) -> None:
        with Bus("sim://gd350") as bus:
            with pytest.raises(ZeroDivisionError):
                bus.step_aside(lambda: 1 / 0)
            assert bus.read(1, 0x2103)

    def test_a_call_from_within_waits_for_nothing(self) -> None:
        with Bus("sim://gd350") as bus, pytest.raises(NotAllowed):
            bus.step_aside(lambda: bus.read(1, 0x2103))
