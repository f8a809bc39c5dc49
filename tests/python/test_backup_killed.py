"""What is cut off at any moment goes on where it was, and a restore wears the memory of no parameter twice."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from drivebus import Backup, Bus, Drive, Simulator

from .kept import stored

DiesAt = Callable[[int, bool], AbstractContextManager[None]]
LOST = 1000
"""More requests than a process makes until it is killed."""
MOMENTS = 50
SEED = 5
SET = {
    "P00.03": 60.0,
    "P00.04": 55.0,
    "P00.06": 8,
    "P00.11": 3.0,
    "P00.12": 4.0,
    "P01.08": 1,
    "P01.20": 1.5,
    "P08.06": 700,
    "P09.01": -12.5,
    "P10.01": 1,
}
"""Values that are not those of the factory."""
BAUD, SILENCE = 921_600, 0.0002
"""A line in real time, and as quick as that may be."""


def set_back(drive: Drive, factory: Mapping[str, Any]) -> None:
    """What is limited goes down before its limit."""
    store(drive, {"P00.04": factory["P00.04"]})
    store(drive, {code: value for code, value in factory.items() if code != "P00.04"})


def store(drive: Drive, values: Mapping[str, Any]) -> None:
    """Stores parameters, whatever is known of them: the drive is the judge."""
    for code, value in values.items():
        drive.bus.write(drive.unit, drive.profile.address(code, store=True), drive.profile.encode(code, value))


def ready(simulator: Simulator) -> tuple[Backup, dict[str, Any]]:
    """A drive with other values than its backup has."""
    with Bus(simulator) as bus:
        drive = bus.drive(1, "gd350")
        factory = drive.read(*SET)
        assert isinstance(factory, dict)
        # A response delay of a real drive is no part of what is shown here.
        store(drive, {**SET, "P14.03": 0})
        kept = drive.backup()
        set_back(drive, factory)
        assert len(drive.diff(kept)) == len(SET)
    return kept, factory


def requests_of_a_restore() -> int:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        kept, _ = ready(simulator)
        before = simulator.line.requests
        with Bus(simulator) as bus:
            bus.drive(1, "gd350").restore(kept)
        return int(simulator.line.requests - before)


def test_cut_off_at_fifty_moments_and_more(dies_at: DiesAt) -> None:
    """Each attempt is cut off a second time before the last one is let through."""
    chance = random.Random(SEED)
    requests = requests_of_a_restore()
    for _ in range(MOMENTS):
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
            kept, _ = ready(simulator)
            stored(simulator)
            for _ in range(2):
                with dies_at(chance.randint(1, requests), chance.random() < 0.5), Bus(simulator) as bus:
                    bus.drive(1, "gd350").restore(kept)
            with Bus(simulator) as bus:
                drive = bus.drive(1, "gd350")
                assert drive.restore(kept).ok
                simulator.drive(1).power_cycle()
                assert not drive.diff(kept)
            assert sorted(stored(simulator)) == sorted(map(drive.profile.address, SET))


CHILD = f"""
import os, signal, sys, traceback
from drivebus import Bus

path, what = sys.argv[1:]
for port in map(str.strip, sys.stdin):
    child = os.fork()
    if child == 0:
        try:
            with Bus(port, baudrate={BAUD}, silence={SILENCE}) as bus:
                getattr(bus.drive(1, "gd350"), what)(path)
        except BaseException:
            traceback.print_exc()
            signal.pause()
        os._exit(0)
    print(child, flush=True)
    _, status = os.waitpid(child, 0)
    print(status, flush=True)
"""
"""For each port it is told, a process of its own does it; forked, for to start one takes long.

One that gives up, as nobody answers, waits to be killed: on a busy machine that comes late.
"""


@pytest.mark.skipif(os.name == "nt", reason="no pty, and no kill -9")
def test_killed_in_earnest(tmp_path: Path) -> None:
    """A process of its own is killed at a seeded request of its restore; the line and the drive live on."""
    chance = random.Random(SEED)
    requests = requests_of_a_restore()
    path = tmp_path / "drive.toml"
    with Simulator({1: "gd350"}, baudrate=BAUD, silence=SILENCE) as simulator, children(path, "restore") as parent:
        kept, factory = ready(simulator)
        kept.save(path)
        for _ in range(MOMENTS):
            stored(simulator)
            assert killed(parent, simulator, chance.randint(1, requests - 1)) == -signal.SIGKILL
            with Bus(simulator) as bus:
                drive = bus.drive(1, "gd350")
                assert drive.restore(path).ok
                assert not drive.diff(path)
                assert sorted(stored(simulator)) == sorted(map(drive.profile.address, SET))
                set_back(drive, factory)


@pytest.mark.skipif(os.name == "nt", reason="no pty, and no kill -9")
def test_a_backup_that_was_killed_goes_on(tmp_path: Path) -> None:
    """Nothing of Python's own runs when it is killed: what is kept was kept before."""
    chance = random.Random(SEED)
    path = tmp_path / "drive.toml"
    with Simulator({1: "gd350"}, baudrate=BAUD, silence=SILENCE) as simulator, children(path, "backup") as parent:
        ready(simulator)
        with Bus(simulator) as bus:
            before = simulator.line.requests
            whole = bus.drive(1, "gd350").backup()
            requests = simulator.line.requests - before
        gone_on: list[int] = []
        for _ in range(10):
            assert killed(parent, simulator, chance.randint(16, 22)) == -signal.SIGKILL
            assert not path.exists()
            with Bus(simulator) as bus:
                there = len(Backup.load(path.with_name(f"{path.name}.part")))
                before = simulator.line.requests
                taken = bus.drive(1, "gd350").backup(path)
            assert taken.raw == whole.raw
            assert simulator.line.requests - before < requests
            gone_on.append(there)
            path.unlink()
    assert all(0 < done < len(whole) for done in gone_on)


@contextmanager
def children(path: Path, what: str) -> Iterator[subprocess.Popen[str]]:
    """What starts a process that does *what* with *path*, again and again."""
    words = [sys.executable, "-c", CHILD, str(path), what]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parent:
        yield parent
        assert parent.stdin is not None
        parent.stdin.close()


def killed(parent: subprocess.Popen[str], simulator: Simulator, requests: int) -> int:
    """How a process ended that was killed after *requests* on the line.

    From then on the drive does what it is told and its answers are lost, so that no process is done before it is
    killed, however late that is.
    """
    assert parent.stdin is not None
    assert parent.stdout is not None
    pause = threading.Event()
    moment = simulator.line.requests + requests
    simulator.line.script([(number, "silence") for number in range(requests, requests + LOST)])
    print(simulator.port, file=parent.stdin, flush=True)
    child = int(parent.stdout.readline())
    with suppress(ProcessLookupError):  # it was done before
        while simulator.line.requests < moment:  # the limit is the test's own
            os.kill(child, 0)
            pause.wait(0.0005)
        os.kill(child, signal.SIGKILL)
    status = int(parent.stdout.readline())
    simulator.line.clear()
    return os.waitstatus_to_exitcode(status)
