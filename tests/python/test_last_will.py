"""A program that runs a motor is killed: who has the port halts the drive, and nobody else feeds its time-out before.

Real programs on one pseudo-terminal, whose drive has its own process, its own motor and its own bus time-out: what it
says of them counts (`workshop`). How long a halt takes is told by `tools/measure_ends.py`, and not judged here.
"""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

import drivebus
from drivebus import _native
from drivebus.line.blocking import BlockingBus
from drivebus.operations.drive_view import DriveView
from drivebus.operations.last_will import LastWill

from .workshop import Said, Workshop

pytestmark = [pytest.mark.skipif(os.name == "nt", reason="no pty"), pytest.mark.usefixtures("folder")]

OPEN = """
import os, sys, threading, time
import drivebus
bus = drivebus.Bus(sys.argv[1], parity="N", timeout=1.0)
drive = bus.drive(1, "gd350")
def say(*words): print(*words, flush=True)
"""
RUNS = (
    OPEN
    + """
with drive.running(10.0):
    say("running")
    time.sleep(1000)
"""
)
GUARDS = (
    OPEN
    + """
with drive.watchdog(2.0, unverified=True):
    drive.run(10.0)
    say("running")
    time.sleep(1000)
"""
)
WATCHES = (
    OPEN
    + """
say("open")
while True:
    try:
        drive.state()
    except drivebus.NotAllowed as error:
        say(error)
    except drivebus.DrivebusError:
        pass
"""
)
WAITS = (
    OPEN
    + """
say("open")
time.sleep(1000)
"""
)
QUESTION = "010321030001"


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workshop]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    workshop = Workshop()
    yield workshop
    workshop.close()


@contextmanager
def program(shop: Workshop, text: str, *more: str) -> Iterator[subprocess.Popen[str]]:
    """A program of its own, once it has said that it is there."""
    child = subprocess.Popen(
        [sys.executable, "-c", text, shop.port, *more], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    try:
        assert child.stdout.readline().strip() in ("running", "open")
        yield child
    finally:
        child.kill()
        child.communicate()


def kill(child: subprocess.Popen[str]) -> float:
    """Kills it. Returns when that was."""
    now = time.monotonic()
    child.kill()
    child.wait()
    return now


def is_halt(said: Said) -> bool:
    return said.is_halt


def stands(said: Said) -> bool:
    return said.kind == "stands"


def asks_the_state(said: Said) -> bool:
    return said.kind == "frame" and said.what.startswith("01032100")


def asks_only_who_it_is(frames: list[Said]) -> bool:
    """Whether *frames* ask what it is, and nothing that others do; echoes make sure whose answer comes."""
    asks = [said.what for said in frames]
    return QUESTION in asks and all(ask[:4] in ("0103", "0108") and ask[4:8] != "2100" for ask in asks)


@pytest.mark.parametrize("runs", [RUNS, GUARDS], ids=["a block", "a watchdog"])
def test_a_guest_that_is_killed_is_halted_for_by_the_owner(shop: Workshop, runs: str) -> None:
    with program(shop, WATCHES), program(shop, runs) as child:
        shop.wait_for(asks_the_state)
        killed = kill(child)
        halt = shop.wait_for(is_halt, killed)
        stood = shop.wait_for(stands, killed)
        print(f"kill to halt {halt.at - killed:.3f} s, to standing {stood.at - killed:.3f} s")
        assert stood.what == ("5" if runs is RUNS else "6"), "by the block's stop; a watchdog was told to coast"
        shop.wait_for(asks_the_state, halt.at)
        assert [said.is_halt for said in shop.frames(killed)].count(True) == 1, "once, as it was taken"


def test_an_owner_that_is_killed_is_halted_for_by_who_comes_after_it_first_of_all(shop: Workshop) -> None:
    with program(shop, GUARDS) as owner, program(shop, WATCHES):
        shop.wait_for(asks_the_state)
        killed = kill(owner)
        halt = shop.wait_for(is_halt, killed)
        print(f"kill to halt {halt.at - killed:.3f} s")
        shop.wait_for(stands, killed)
        shop.wait_for(asks_the_state, halt.at)
        # What was on its way when it was killed may still come; then who takes the port over is silent for a moment.
        after = [said for said in shop.frames(killed) if said.at > killed + 0.04]
        assert asks_only_who_it_is(after[: after.index(halt)])


def test_who_opens_the_port_later_halts_before_anything_else_and_says_so(shop: Workshop) -> None:
    with program(shop, RUNS) as owner:
        kill(owner)
    opened = time.monotonic()
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus:
        assert bus.drive(1, "gd350").state() is drivebus.State.STOPPED
        halt = shop.wait_for(is_halt, opened)
        shop.wait_for(asks_the_state, halt.at)
        came = shop.frames(opened)
        assert halt.what == "010620000005"
        assert asks_only_who_it_is(came[: came.index(halt)])
        [note] = [note for note in bus.stats()["wills"] if "halt" in note]
        assert note.startswith("unit 1 was told to halt, and took it: python")
        assert f"(process {owner.pid}), which ran it, is gone" in note


def test_until_it_takes_a_halt_nobody_else_asks_it(shop: Workshop) -> None:
    with program(shop, WATCHES) as other, program(shop, GUARDS) as child:
        shop.tell("refuse 06")
        killed = kill(child)
        halts = [shop.wait_for(is_halt, killed)]
        while len(halts) < 8:
            halts.append(shop.wait_for(is_halt, halts[-1].at + 1e-6))
        assert other.stdout is not None
        refused = other.stdout.readline()
        between = [said.what for said in shop.frames(halts[0].at) if said.at < halts[-1].at]
        assert set(between) == {"010620000005", "010620000006"}, "its ways alone, and nothing of others"
        assert [said.what[-1] for said in halts] == ["6", "5"] * 4
        taken = shop.tell("take")
        shop.wait_for(stands, taken)
        shop.wait_for(asks_the_state, taken)
    assert "unit 1 is being stopped for python" in refused
    assert f"(process {child.pid}), which is gone without a word; nothing was sent" in refused


def test_others_may_stop_it_meanwhile(shop: Workshop) -> None:
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus, program(shop, RUNS) as child:
        drive = bus.drive(1, "gd350")
        shop.tell("refuse 06")
        killed = kill(child)
        shop.wait_for(is_halt, killed)
        # It is sent. What the unit says to it may be late on a busy machine.
        with pytest.raises((drivebus.Refused, drivebus.Unconfirmed)):
            drive.stop(within=0.3)
        with pytest.raises(drivebus.NotAllowed, match=rf"process {child.pid}\), which is gone .* nothing was sent"):
            drive.write("P00.11", 3.0)
        shop.tell("take")
        shop.wait_for(stands, killed)


def test_a_drive_at_the_address_of_no_family_that_is_known_gets_nothing(shop: Workshop) -> None:
    with program(shop, RUNS) as owner:
        kill(owner)
    opened = shop.tell("code 0180")  # an IMO SD1
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus:
        assert bus.read(1, 0x2103) == [0x0180]
        assert any("another drive answers at its address now" in note for note in bus.stats()["wills"])
        shop.wait_for(lambda said: said.kind == "frame" and said.what == QUESTION, opened)
        bus.read(1, 0x2100)
        shop.wait_for(asks_the_state, opened)
    assert not [said for said in shop.frames(opened) if said.is_halt]


def note_of_the_halt(bus: drivebus.Bus) -> str:
    """What is told of the halt of unit 1, once it was looked at."""
    while True:
        for note in bus.stats().wills:
            if "took it" in note and "is gone. " in note:
                return note


def test_another_family_at_the_address_is_halted_as_that_and_by_no_word_that_runs_it(shop: Workshop) -> None:
    """What stops a GD350 runs an EDS300 (its manual, p. 44), and refuses to tell a code."""
    with program(shop, RUNS) as owner:
        kill(owner)
    swapped = shop.tell("eds300")
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus:
        assert shop.wait_for(stands, swapped).what == "6"
        note = note_of_the_halt(bus)
    assert "it is another drive (ENC EDS300), and was halted as that. Its state proves the halt" in note
    assert [said.what for said in shop.frames(swapped) if said.is_halt] == ["010620000006"]


def test_one_that_refuses_to_stop_and_coasts_is_told_both_and_is_seen_to_stand(shop: Workshop) -> None:
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus, program(shop, RUNS) as child:
        shop.tell("coast 03")
        killed = kill(child)
        assert shop.wait_for(stands, killed).what == "6"
        assert note_of_the_halt(bus).endswith(
            f"(process {child.pid}), which ran it, is gone. Its state proves the halt"
        )
    assert [said.what[-1] for said in shop.frames(killed) if said.is_halt] == ["5", "6"]


def test_one_that_takes_a_halt_and_runs_on_is_told_of(shop: Workshop) -> None:
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus, program(shop, RUNS) as child:
        shop.tell("stuck")
        kill(child)
        note = note_of_the_halt(bus)
        # Others may ask it since it took that.
        assert bus.drive(1, "gd350").state() is drivebus.State.FORWARD
    assert "is gone. It is not proved: it was taken, and the state does not show it: forward" in note


def test_what_ran_long_ago_is_not_halted_unasked(shop: Workshop) -> None:
    with program(shop, RUNS) as owner:
        kill(owner)
    [will] = Path(_native.run_time_folder()).glob("*.will")
    alive = will.read_bytes()
    old = int.from_bytes(alive[:8], "little") - 301 * 10**9
    with will.open("r+b") as file:
        file.write(struct.pack("<Q", max(old, 1)))
    opened = time.monotonic()
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus:
        bus.read(1, 0x2100)
        shop.wait_for(asks_the_state, opened)
        assert any("is gone for long" in note for note in bus.stats()["wills"])
    assert not [said for said in shop.frames(opened) if said.is_halt]
    assert not will.exists()


ENDS = (
    OPEN
    + """
with drive.running(10.0):
    say("running")
    sys.stdin.readline()
say("ended")
sys.stdin.readline()
"""
)


def test_a_block_that_ended_leaves_nothing(shop: Workshop) -> None:
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus, program(shop, ENDS) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert list(Path(_native.run_time_folder()).glob("*.will"))
        child.stdin.write("\n")
        child.stdin.flush()
        assert child.stdout.readline() == "ended\n"
        assert not list(Path(_native.run_time_folder()).glob("*.will"))
        killed = kill(child)
        for _ in range(5):
            bus.read(1, 0x2100)
        shop.wait_for(asks_the_state, killed)
    assert not [said for said in shop.frames(killed) if said.is_halt]


def test_a_command_says_what_it_halted_unasked(shop: Workshop) -> None:
    with program(shop, RUNS) as owner:
        killed = kill(owner)
    options = ["--port", shop.port, "--format", "8N1", "--profile", "gd350"]
    done = subprocess.run(
        [sys.executable, "-m", "drivebus", *options, "status"], capture_output=True, text=True, check=False
    )
    shop.wait_for(stands, killed)
    assert f"unit 1 was told to halt, and took it: python (process {owner.pid})" in " ".join(done.stderr.split())


ASKS_NOTHING = OPEN + 'say("open")\nsys.stdin.readline()\n'


@pytest.mark.parametrize("beside", [1, 3])
def test_a_guest_that_asks_for_nothing_halts_for_the_owner(shop: Workshop, beside: int) -> None:
    """Nobody else would open the port: its program waits for its user, say."""
    with ExitStack() as stack:
        owner = stack.enter_context(program(shop, RUNS))
        for _ in range(beside):
            stack.enter_context(program(shop, ASKS_NOTHING))
        killed = kill(owner)
        shop.wait_for(is_halt, killed)
        shop.wait_for(stands, killed)


KILLS = """
import os, signal, sys
import drivebus
bus = drivebus.Bus(sys.argv[1], parity="N", timeout=1.0)
os.kill(int(sys.argv[2]), signal.SIGKILL)
print("open", flush=True)
sys.stdin.readline()
"""


@pytest.mark.parametrize("attempt", range(3))
def test_a_guest_halts_for_an_owner_that_is_killed_when_it_has_just_come_in(shop: Workshop, attempt: int) -> None:
    """Before it waits there: its second connection may be on its way, or in the queue at the door."""
    assert attempt in range(3)
    with program(shop, RUNS) as owner, program(shop, KILLS, str(owner.pid)):
        shop.wait_for(is_halt)
        shop.wait_for(stands)


@pytest.mark.parametrize("comes_first", [True, False], ids=["it ran before", "it runs later"])
def test_one_that_asks_for_nothing_halts_for_who_had_the_port_after_the_first_one(
    shop: Workshop, comes_first: bool
) -> None:
    """The first one ends as it should: nobody is to be halted then, and nobody asks for the port."""
    with ExitStack() as stack:
        first = stack.enter_context(program(shop, ASKS_NOTHING))
        runs = stack.enter_context(program(shop, RUNS)) if comes_first else None
        stack.enter_context(program(shop, ASKS_NOTHING))
        first.communicate("\n")
        runs = runs or stack.enter_context(program(shop, RUNS))
        killed = kill(runs)
        shop.wait_for(is_halt, killed)
        shop.wait_for(stands, killed)


def test_a_port_of_which_nobody_is_halted_is_not_taken_over_unasked(shop: Workshop) -> None:
    """The user may want it for another program."""
    with program(shop, ASKS_NOTHING) as owner, program(shop, ASKS_NOTHING):
        kill(owner)
        # For longer than it is looked for somebody who is to be halted.
        for _ in range(40):
            with drivebus.Bus(shop.port, parity="N", timeout=1.0, share="never") as bus:
                bus.read(1, 0x2100)


FORKS = (
    OPEN
    + """
with drive.running(10.0):
    child = os.fork()
    if child == 0:
        time.sleep(1000)
    say("running")
    say(child)
    time.sleep(1000)
"""
)


def test_a_child_that_lives_on_does_not_count_as_its_parent(shop: Workshop) -> None:
    """It has the connections, and all files, of the program that is killed."""
    with program(shop, WATCHES), program(shop, FORKS) as child:
        assert child.stdout is not None
        grandchild = int(child.stdout.readline())
        try:
            killed = kill(child)
            shop.wait_for(is_halt, killed)
            shop.wait_for(stands, killed)
        finally:
            os.kill(grandchild, signal.SIGKILL)


def test_one_that_is_only_stopped_is_not_gone(shop: Workshop) -> None:
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as bus, program(shop, RUNS) as child:
        child.send_signal(signal.SIGSTOP)
        os.waitid(os.P_PID, child.pid, os.WSTOPPED | os.WNOWAIT)
        stopped = time.monotonic()
        # Longer than it takes to look whether it lives.
        while time.monotonic() < stopped + 0.3:
            bus.read(1, 0x2100)
        assert not [said for said in shop.frames(stopped) if said.is_halt]
        killed = kill(child)
        shop.wait_for(is_halt, killed)


def test_a_bus_that_is_closed_while_a_watchdog_is_set_is_halted_for(shop: Workshop) -> None:
    with drivebus.Bus(shop.port, parity="N", timeout=1.0) as owner:
        guest = drivebus.Bus(shop.port, parity="N", timeout=1.0)
        drive = guest.drive(1, "gd350")
        watchdog = drive.watchdog(5.0, unverified=True)
        drive.run(10.0)
        closed = time.monotonic()
        guest.close()
        shop.wait_for(is_halt, closed)
        shop.wait_for(stands, closed)
        owner.read(1, 0x2100)
        watchdog.close()


@pytest.mark.parametrize("family", drivebus.profiles())
def test_what_is_left_halts_each_family(family: str) -> None:
    """The requests of a will, as they are, sent to a drive that runs."""
    with (
        drivebus.Simulator({1: family}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        left: list[list[list[bytes]]] = []

        class Line:
            """Keeps what is left."""

            port = ""

            def leave_will(self, unit: int, ways: list[list[bytes]], **_: object) -> int:
                assert unit == 1
                left.append(ways)
                return 1

            def withdraw_will(self, number: int) -> None:
                assert number == 1

        class Face(BlockingBus):
            line = Line()

        profile = drivebus.Profile.find(family)
        unit = DriveView.create(Face(bus), 1, profile, None, unverified=True, trust_profile=True)
        LastWill(unit).leave()
        wanted = [way for way in ("stop", "coast") if way in profile.commands()]
        assert len(left[0] if left else []) == len(wanted)
        simulated = simulator.drive(1)
        for way in left[0] if left else []:
            drive = bus.drive(1, family, unverified=True, trust_profile=True)
            drive.prepare_control(store=True)
            simulator.advance(100)
            drive.run(5.0 if "frequency" in profile.setpoint_names() else None)
            for pdu in way:
                bus.transact(1, pdu, force=True)
            simulator.advance(1000)
            assert simulated.state == "stopped", way


@pytest.mark.parametrize(
    ("transport", "says"), [("pty", ""), ("tcp", "other computers may use this serial server"), ("process", "")]
)
def test_a_watchdog_says_what_it_cannot_promise(transport: str, says: str) -> None:
    """Who asks the drive keeps it from acting by itself, and of another computer nothing is known here."""
    with (
        drivebus.Simulator({1: "gd350"}, transport=transport) as simulator,
        drivebus.Bus(simulator.port if transport != "process" else simulator) as bus,
        bus.drive(1).watchdog(2.0, unverified=True) as watchdog,
    ):
        assert says in watchdog.unsure
        assert bool(says) == bool(watchdog.unsure)
        assert watchdog.unsure in repr(watchdog)
