"""What a program knows of a port that another one has: without waiting for that one, in an event loop least of all."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
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

from .reopened import read_once_open

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="whether a process is held is asked of /proc")

IDENTIFICATION, GD350 = 0x2103, 0x01A0
PATIENCE = 20.0  # seconds for which the other program is held; only a test that fails sees their end
# Who waits for that program waits a second each time: so many of them outlast it.
TIMES = 40
HELLO = b"drivebus share \x09\x04test\x80\x96\x01\x08N\x01\x00"  # at 19200 8N1
WATCH, RECONNECTS = b"\x06", b"\x08"


@pytest.fixture
def line(folder: Path) -> Iterator[Simulator]:
    assert not folder.exists()
    with Simulator({1: "gd350"}, transport="pty", parity="N") as simulator:
        yield simulator


@pytest.fixture
def server(folder: Path) -> Iterator[Simulator]:
    """One whose port is opened again under the same name."""
    assert not folder.exists()
    with Simulator({1: "gd350"}, transport="tcp", parity="N") as simulator:
        yield simulator


@contextmanager
def owner(line: Simulator) -> Iterator[subprocess.Popen[str]]:
    """A program of its own that has the port, has read twice, and does nothing more."""
    text = f"""
import drivebus, sys
bus = drivebus.Bus({line.port!r}, parity="N", timeout=5.0)
bus.read(1, {IDENTIFICATION}), bus.read(1, {IDENTIFICATION})
print("open", flush=True)
sys.stdin.readline()
"""
    child = subprocess.Popen([sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None
        assert child.stdout.readline() == "open\n"
        yield child
    finally:
        child.kill()
        child.communicate()


def state(process: subprocess.Popen[str]) -> str:
    return Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]


@contextmanager
def held(process: subprocess.Popen[str]) -> Iterator[None]:
    """The program is held meanwhile, and still is at the end."""
    process.send_signal(signal.SIGSTOP)
    while state(process) != "T":
        pass
    lets_go = threading.Timer(PATIENCE, process.send_signal, (signal.SIGCONT,))
    lets_go.start()
    try:
        yield
        assert state(process) == "T", "somebody waited until it went on"
    finally:
        lets_go.cancel()
        process.send_signal(signal.SIGCONT)


async def turns(count: int) -> None:
    """Lets the event loop turn so often."""
    for _ in range(count):
        await asyncio.sleep(0)


class TestAnEventLoopGoesOn:
    def test_while_it_is_asked_how_often_the_port_was_opened(self, line: Simulator) -> None:
        async def ask() -> None:
            async with aio.Bus(line.port, parity="N", timeout=5.0) as bus:
                assert await bus.read(1, IDENTIFICATION) == [GD350]
                with held(process):
                    for _ in range(TIMES):
                        assert bus.reconnects == 0
                        await turns(1)
                assert await bus.read(1, IDENTIFICATION) == [GD350]

        with owner(line) as process:
            asyncio.run(ask())

    @pytest.mark.parametrize("what", ["link", "echo"])
    def test_while_something_is_asked_that_the_other_program_knows(self, line: Simulator, what: str) -> None:
        async def ask() -> object:
            async with aio.Bus(line.port, parity="N", timeout=5.0) as bus:
                with held(process):
                    asked = [asyncio.ensure_future(getattr(bus, what)(1)) for _ in range(TIMES)]
                    await turns(10)
                for each in asked:
                    each.cancel()
                await asyncio.gather(*asked, return_exceptions=True)
                return await getattr(bus, what)(1)

        with owner(line) as process:
            told = asyncio.run(ask())
        if what == "link":
            assert isinstance(told, drivebus.Link)
            assert told.good == told.asked >= 2, "what the other program saw"
        else:
            assert isinstance(told, float)
            assert told > 0.0


class TestHowOftenThePortWasOpened:
    def test_is_told_who_asks_for_nothing(self, server: Simulator) -> None:
        with Bus(server.port, parity="N") as owner, Bus(server.port, parity="N") as guest:
            assert guest.stats()["notes"] == [f"python (process {os.getpid()}) has the port; requests go through it"]
            for count in (1, 2):
                assert owner.read(1, IDENTIFICATION) == [GD350]
                server.line.unplug()
                with pytest.raises(PortError):
                    owner.read(1, IDENTIFICATION)
                server.line.replug()
                assert read_once_open(owner, IDENTIFICATION) == [GD350]
                while guest.reconnects < count:
                    pass
                assert (owner.reconnects, guest.reconnects) == (count, count)

    def test_is_said_with_each_answer(self, server: Simulator) -> None:
        with Bus(server.port, parity="N") as owner, Bus(server.port, parity="N") as guest:
            assert guest.read(1, IDENTIFICATION) == [GD350]
            server.line.unplug()
            with pytest.raises(PortError):
                owner.read(1, IDENTIFICATION)
            server.line.replug()
            assert read_once_open(guest, IDENTIFICATION) == [GD350]
            assert guest.reconnects == 1


class TestWhoIsToldSo:
    """A program that speaks the protocol by hand."""

    def say(self, guest: socket.socket, message: bytes) -> None:
        guest.sendall(struct.pack("<I", len(message)) + message)

    def hear(self, guest: socket.socket) -> bytes:
        """The next message; empty at the end."""
        head = guest.recv(4, socket.MSG_WAITALL)
        return guest.recv(struct.unpack("<I", head)[0], socket.MSG_WAITALL) if len(head) == 4 else b""

    @contextmanager
    def watching(self, folder: Path) -> Iterator[socket.socket]:
        [path] = folder.glob("*.sock")
        with socket.socket(socket.AF_UNIX) as guest:
            guest.connect(str(path))
            self.say(guest, HELLO)
            assert self.hear(guest)[0] == 0
            self.say(guest, WATCH)
            assert self.hear(guest) == RECONNECTS + b"\x00"
            yield guest

    def test_hears_each_opening(self, server: Simulator, folder: Path) -> None:
        with Bus(server.port, parity="N") as bus, self.watching(folder) as guest:
            for count in (b"\x01", b"\x02"):
                assert bus.read(1, IDENTIFICATION) == [GD350]
                server.line.unplug()
                with pytest.raises(PortError):
                    bus.read(1, IDENTIFICATION)
                server.line.replug()
                assert bus.read(1, IDENTIFICATION) == [GD350]
                assert self.hear(guest) == RECONNECTS + count

    def test_may_wish_for_nothing_else_there(self, line: Simulator, folder: Path) -> None:
        with Bus(line.port, parity="N") as bus, self.watching(folder) as guest:
            self.say(guest, WATCH)
            assert self.hear(guest) == b""
            assert bus.read(1, IDENTIFICATION) == [GD350]
