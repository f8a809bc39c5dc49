"""One port, several programs: real processes on one pseudo-terminal.

What the wire carried, and what the drives took, is asked of the simulator.
"""

from __future__ import annotations

import asyncio
import os
import random
import signal
import socket
import stat
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, PortError, Simulator, aio

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pty")

CONTROL, FREE, STOP = 0x2000, 0x8000 | 0x000B, 5
READ_STATE = bytes.fromhex("01 03 21 00")
HELLO = b"drivebus share \x09"


@pytest.fixture
def line(folder: Path) -> Iterator[Simulator]:
    assert not folder.exists()
    with Simulator({1: "gd350", 2: "gd350"}, transport="pty", baudrate=115_200, parity="N") as simulator:
        yield simulator


def open_bus(line: Simulator, **how: object) -> Bus:
    """A bus, by default with a time-out that no answer reaches, however busy the machine is."""
    how = {"timeout": 5.0, **how}
    return Bus(line.port, baudrate=115_200, parity="N", **how)  # type: ignore[arg-type]  # as the test has it


def the_socket(folder: Path) -> Path:
    [found] = folder.glob("*.sock")
    return found


def requests(line: Simulator) -> list[bytes]:
    return [data for _, who, data in line.line.trace() if who == "master"]


def written(line: Simulator, unit: int) -> list[int]:
    return [value for _, address, value in line.drive(unit).writes() if address == FREE]


@contextmanager
def program(line: Simulator, text: str, **how: object) -> Iterator[subprocess.Popen[str]]:
    """A program of its own with the bus `bus` open, which says `open` then and goes on when it is told anything."""
    begin = f"""
import drivebus, sys
bus = drivebus.Bus({line.port!r}, baudrate=115_200, parity="N", timeout=1.0)
print("open", flush=True)
sys.stdin.readline()
"""
    child = subprocess.Popen(
        [sys.executable, "-c", begin + text],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **how,  # type: ignore[call-overload]  # as the test has it
    )
    try:
        assert said(child) == "open"
        yield child
    finally:
        child.kill()
        child.communicate()


def run(text: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=False)


def said(child: subprocess.Popen[str]) -> str:
    assert child.stdout is not None
    return child.stdout.readline().strip()


def ask_nobody(bus: Bus, line: Simulator) -> threading.Thread:
    """Asks unit 9, which is not there; comes back when that is on the wire, for as long as the time-out."""

    def ask() -> None:
        with pytest.raises(drivebus.NoAnswer):
            bus.read(9, 0x2100)

    asking = threading.Thread(target=ask)
    asking.start()
    while not any(frame[0] == 9 for frame in requests(line)):
        pass
    return asking


def tell(child: subprocess.Popen[str]) -> None:
    assert child.stdin is not None
    child.stdin.write("go\n")
    child.stdin.flush()


class TestTwoPrograms:
    def test_the_second_comes_in_through_the_first(self, line: Simulator) -> None:
        with open_bus(line) as bus, program(line, "print(bus.read(1, 0x2103), bus.stats()['notes'])") as other:
            tell(other)
            assert said(other) == f"[416] ['python (process {os.getpid()}) has the port; requests go through it']"
            [guest] = bus.stats()["programs"]
            assert (guest["process"], guest["calls"], guest["answered"]) == (other.pid, 1, 1)

    def test_settings_that_differ_are_named(self, line: Simulator) -> None:
        with open_bus(line), pytest.raises(PortError) as error:
            Bus(line.port, baudrate=9600)
        assert str(error.value) == (
            f"{line.port}: python (process {os.getpid()}) has the port open at 115200 8N1, and 9600 8E1 is asked for; "
            "ask for the same, or end that program"
        )

    def test_who_shares_nothing_finds_it_busy_and_serves_nobody(self, line: Simulator, folder: Path) -> None:
        with open_bus(line), pytest.raises(PortError, match="this program has it open already"):
            open_bus(line, share="never")
        for alone in ("own", "never"):
            with open_bus(line, share=alone) as bus:
                assert list(folder.glob("*.sock")) == []
                with pytest.raises(PortError, match="this program has it open already"):
                    open_bus(line)
                assert bus.read(1, 0x2103) == [0x01A0]

    def test_one_that_serves_nobody_still_comes_in(self, line: Simulator) -> None:
        with open_bus(line), open_bus(line, share="own") as bus:
            assert bus.read(1, 0x2103) == [0x01A0]

    def test_each_has_its_own_rules(self, line: Simulator) -> None:
        with open_bus(line, read_only=True) as first, open_bus(line) as second:
            second.write(1, FREE, 7)
            with pytest.raises(drivebus.NotAllowed, match="read-only"):
                first.write(1, FREE, 8)
        with open_bus(line) as first, open_bus(line, read_only=True) as second:
            first.write(1, FREE, 9)
            with pytest.raises(drivebus.NotAllowed, match="read-only"):
                second.write(1, FREE, 10)
        assert written(line, 1) == [7, 9]

    def test_an_event_loop_comes_in(self, line: Simulator) -> None:
        async def work() -> list[list[int]]:
            async with aio.Bus(line.port, baudrate=115_200, parity="N") as bus:
                return await asyncio.gather(*(bus.read(1 + turn % 2, 0x2103) for turn in range(100)))

        with open_bus(line):
            assert asyncio.run(work()) == [[0x01A0]] * 100

    def test_a_poll_goes_on_when_the_first_ends(self, line: Simulator) -> None:
        first = open_bus(line)
        with open_bus(line) as second, second.poll({1: [(0x2103, 1)]}) as poll:
            samples = iter(poll)
            next(samples)
            first.close()
            came = [next(samples) for _ in range(200)]
            assert all(sample.missing or list(sample.values()) == [0x01A0] for sample in came)
            assert not came[-1].missing
            assert second.reconnects == 1
            assert not any("has the port" in note for note in second.stats()["notes"])

    def test_a_forked_child_uses_neither(self, line: Simulator) -> None:
        with open_bus(line), open_bus(line) as guest:
            guest.read(1, 0x2103)
            child = os.fork()
            if child == 0:
                try:
                    guest.read(1, 0x2103)
                except PortError:
                    guest.close()
                    os._exit(7)
                os._exit(1)
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
            assert guest.read(1, 0x2103) == [0x01A0]


class TestWhoGoesFirst:
    def test_a_stop_of_any_program_is_the_next_request(self, line: Simulator) -> None:
        with open_bus(line, timeout=3.0, retries=0) as owner, open_bus(line) as polling, open_bus(line) as stopping:
            drive = stopping.drive(1)  # it says what it is, so that nothing has to be asked before its stop
            stopping.read(1, 0x2100)
            polling.read(1, 0x2100)
            silent = ask_nobody(owner, line)
            readers = [threading.Thread(target=polling.read, args=(2, 0x2100)) for _ in range(20)]
            for reader in readers:
                reader.start()
            drive.stop()
            frames = requests(line)
            after = frames[next(place for place, frame in enumerate(frames) if frame[0] == 9) + 1]
            assert after[:6] == bytes([1, 6, 0x20, 0, 0, STOP])
            for thread in (*readers, silent):
                thread.join()

    def test_programs_take_turns(self, line: Simulator) -> None:
        """Eight threads of one program take no more than one of another."""
        with open_bus(line) as owner, open_bus(line) as other:
            owner.read(1, 0x2100)
            other.read(2, 0x2100)
            ends = threading.Event()

            def ask(bus: Bus, unit: int) -> None:
                while not ends.is_set():
                    bus.read(unit, 0x2100)

            threads = [threading.Thread(target=ask, args=(owner, 1)) for _ in range(8)]
            threads.append(threading.Thread(target=ask, args=(other, 2)))
            for thread in threads:
                thread.start()
            while len(requests(line)) < 400:
                pass
            ends.set()
            for thread in threads:
                thread.join()
            units = [frame[0] for frame in requests(line)][100:400]
            # One turn may pass while the other program says what it wants next.
            assert units.count(2) >= 75


class TestTheOwnerEnds:
    def test_killed_at_any_moment(self, line: Simulator) -> None:
        """Nothing wrong, nothing twice, and all served again."""
        chance = random.Random(13)
        confirmed: list[int] = []
        unknown: list[int] = []
        ended = threading.Event()
        value = iter(range(1, 60_000))

        def write(bus: Bus) -> None:
            while not ended.is_set():
                word = next(value)
                try:
                    bus.write(2, FREE, word)
                    confirmed.append(word)
                except PortError:
                    unknown.append(word)

        wrong: list[object] = []

        def read(bus: Bus) -> None:
            while not ended.is_set():
                if bus.read(1, 0x2103) != [0x01A0]:
                    wrong.append("a wrong value")

        for _ in range(5):
            with program(line, "while True: bus.read(2, 0x2100)") as owner:
                tell(owner)
                with open_bus(line) as reading, open_bus(line) as writing:
                    ended.clear()
                    threads = [
                        threading.Thread(target=read, args=(reading,)),
                        threading.Thread(target=write, args=(writing,)),
                    ]
                    for thread in threads:
                        thread.start()
                    seen = len(requests(line)) + chance.randrange(5, 60)
                    while len(requests(line)) < seen:
                        pass
                    owner.kill()
                    owner.wait()
                    served = len(confirmed) + 20
                    while len(confirmed) < served:
                        pass
                    ended.set()
                    for thread in threads:
                        thread.join()
                    assert {reading.reconnects, writing.reconnects} == {1}
        taken = written(line, 2)
        assert wrong == []
        assert len(taken) == len(set(taken))
        assert set(confirmed) <= set(taken) <= set(confirmed) | set(unknown)
        assert len(unknown) <= 5

    def test_a_motor_is_still_its_programs_to_stop(self, line: Simulator) -> None:
        with program(line, "sys.stdin.readline()") as owner, open_bus(line, timeout=1.0) as bus:
            drive = bus.drive(1, "gd350")
            drive.prepare_control()
            drive.write({"P00.11": 1.0, "P00.12": 1.0})
            with drive.running(10.0):
                owner.kill()
                owner.wait()
        assert [value for _, address, value in line.drive(1).writes() if address == CONTROL][-1] == STOP

    def test_one_that_is_held_is_named(self, line: Simulator) -> None:
        with program(line, "sys.stdin.readline()") as owner, open_bus(line) as bus:
            bus.read(1, 0x2103)
            owner.send_signal(signal.SIGSTOP)
            with pytest.raises(
                PortError, match=rf"process {owner.pid}\) has the port and is stopped, perhaps by Ctrl-Z"
            ):
                bus.read(1, 0x2103)
            with pytest.raises(PortError, match=rf"kill -CONT {owner.pid}"):
                open_bus(line)
            before = len(requests(line))
            with pytest.raises(PortError):
                bus.write(1, FREE, 77)
            owner.send_signal(signal.SIGCONT)
            assert bus.read(1, 0x2103) == [0x01A0]
            assert 77 not in written(line, 1), "nobody wanted it any more"
            assert len(requests(line)) > before

    def test_what_a_dead_program_wanted_is_not_done(self, line: Simulator) -> None:
        with open_bus(line, timeout=3.0, retries=0) as owner, open_bus(line) as other:
            other.read(1, 0x2103)
            with program(line, f"bus.write(1, {FREE}, 99)") as dying:
                silent = ask_nobody(owner, line)
                tell(dying)
                while not any(one["process"] == dying.pid and one["calls"] for one in owner.stats()["programs"]):
                    pass
                dying.kill()
                dying.wait()
                silent.join()
            assert other.read(1, 0x2103) == [0x01A0]
            assert written(line, 1) == []


class TestHostileGuests:
    def knock(self, folder: Path) -> socket.socket:
        guest = socket.socket(socket.AF_UNIX)
        guest.connect(str(the_socket(folder)))
        return guest

    @staticmethod
    def say(guest: socket.socket, body: bytes) -> None:
        guest.sendall(struct.pack("<I", len(body)) + body)

    @staticmethod
    def hear(guest: socket.socket) -> bytes:
        head = guest.recv(4, socket.MSG_WAITALL)
        return guest.recv(struct.unpack("<I", head)[0], socket.MSG_WAITALL) if head else b""

    @staticmethod
    def greeting() -> bytes:
        name = b"test"
        # postcard: a string with its length, then 115200 in sevens of bits, and three bytes.
        return HELLO + bytes([len(name)]) + name + bytes([0x80, 0x84, 0x07]) + b"\x08N\x01\x00"

    def test_only_this_user_reaches_the_socket(self, line: Simulator, folder: Path) -> None:
        with open_bus(line):
            assert stat.S_IMODE(folder.stat().st_mode) == 0o700
            assert stat.S_IMODE(the_socket(folder).stat().st_mode) == 0o600

    @pytest.mark.skipif(os.name == "nt" or os.geteuid() != 0, reason="only root can be somebody else")
    def test_a_program_of_another_user_gets_nothing(self, line: Simulator, folder: Path) -> None:
        with open_bus(line) as bus:
            for path in (folder.parent, folder):
                path.chmod(0o755)
            the_socket(folder).chmod(0o666)
            Path(line.port).chmod(0o666)
            become = "import os, socket, drivebus; drivebus.Bus; os.setgid(65534); os.setuid(65534)\n"
            knock = f"""
guest = socket.socket(socket.AF_UNIX)
guest.connect({str(the_socket(folder))!r})
print(guest.recv(200)[5:].decode())
print(guest.recv(200))
"""
            done = run(become + knock)
            assert done.stdout.splitlines() == ["this port is open in a program of another user", "b''"], done.stderr
            enter = f"drivebus.Bus({line.port!r}, baudrate=115_200, parity='N')"
            done = run(become + enter)
            assert done.returncode == 1
            assert "another program has it" in done.stderr
            assert bus.stats()["programs"] == []

    def test_one_that_speaks_as_it_must_is_let_in(self, line: Simulator, folder: Path) -> None:
        with open_bus(line), self.knock(folder) as guest:
            self.say(guest, self.greeting())
            assert self.hear(guest)[0] == 0

    def test_one_of_another_version_is_told_so(self, line: Simulator, folder: Path) -> None:
        with open_bus(line), self.knock(folder) as guest:
            self.say(guest, b"drivebus share \x0a whatever that says")
            answer = self.hear(guest)
            assert answer[0] == 1
            assert b"speaks version 9 where this program speaks 10" in answer
            assert self.hear(guest) == b""

    @pytest.mark.parametrize(
        "garbage",
        [b"GET / HTTP/1.1\r\n\r\n", b"\xff" * 100, struct.pack("<I", 3) + b"abc", struct.pack("<I", 0), b"\x01"],
        ids=["http", "huge", "short", "empty", "cut"],
    )
    def test_garbage_is_cut_off(self, line: Simulator, folder: Path, garbage: bytes) -> None:
        with open_bus(line) as bus, self.knock(folder) as guest:
            guest.sendall(garbage)
            while guest.recv(1_000):
                pass
            assert bus.read(1, 0x2103) == [0x01A0]
            assert bus.stats()["programs"] == []

    @pytest.mark.parametrize("seed", range(20))
    def test_garbage_behind_a_greeting_is_cut_off_and_sends_nothing(
        self, line: Simulator, folder: Path, seed: int
    ) -> None:
        chance = random.Random(seed)
        with open_bus(line) as bus:
            bus.read(1, 0x2103)
            before = len(requests(line))
            with self.knock(folder) as guest:
                self.say(guest, self.greeting())
                self.hear(guest)
                # Variants above the last there is: no such wish.
                self.say(guest, bytes([chance.randrange(7, 256)]) + chance.randbytes(chance.randrange(40)))
                while guest.recv(1_000):
                    pass
            assert len(requests(line)) == before
            assert bus.read(1, 0x2103) == [0x01A0]

    def test_who_says_nothing_holds_up_nobody(self, line: Simulator, folder: Path) -> None:
        with open_bus(line) as bus:
            silent = [self.knock(folder) for _ in range(50)]
            with open_bus(line) as other:
                assert other.read(1, 0x2103) == bus.read(1, 0x2103) == [0x01A0]
            for guest in silent:
                guest.close()

    def test_who_floods_is_told_that_no_more_may_come(self, line: Simulator, folder: Path) -> None:
        with open_bus(line) as bus:
            guests, answers = [], []
            for _ in range(140):
                guests.append(self.knock(folder))
                self.say(guests[-1], self.greeting())
                answers.append(self.hear(guests[-1]))
            away = [answer for answer in answers if answer[0] == 1]
            assert len(away) == 140 - 128
            assert b"128 connections" in away[0]
            assert bus.read(1, 0x2103) == [0x01A0]
            for guest in guests:
                guest.close()


@pytest.mark.parametrize("share", ["yes", "", None, True])
def test_a_wrong_word_is_refused(share: object) -> None:
    with pytest.raises(drivebus.NotAllowed, match="share"):
        Bus("sim://gd350?clock=virtual", share=share)  # type: ignore[arg-type]  # that is what is tested


def test_a_folder_that_others_may_enter_is_not_used(line: Simulator, folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)
    with open_bus(line) as bus:
        [note] = bus.stats()["notes"]
        assert note.startswith("other programs cannot use this port through this one:")
        assert str(folder) in note
        assert bus.read(1, 0x2103) == [0x01A0]
