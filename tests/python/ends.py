"""Programs that end while a motor runs, on each kind of port, and the drive that says what it was told.

The simulated drive lives in this process and the program in another, so that the end of the one is not the end of the
other. `tools/measure_ends.py` runs the same programs many times.
"""

from __future__ import annotations

import contextlib
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import serial
import serial.rfc2217

import drivebus
from drivebus import Simulator

CONTROL, FORWARD, STOP = 0x2000, 1, 5
DEAD = 9
"""A unit that nobody is."""

KINDS = ("native", "serial.Serial", "spy", "rfc2217", "socket")
"""The kinds of port that a program may open."""

PRELUDE = """
import asyncio, atexit, faulthandler, os, signal, subprocess, sys, threading, time
import drivebus, drivebus.aio

def say(*words):
    print(*words, flush=True)

def open_bus(face=drivebus.Bus, **keywords):
    kind, port, timeout = sys.argv[1:]
    target = port
    if kind == "serial.Serial":
        import serial
        target = serial.Serial(port, 19200, parity="E")
    elif kind == "spy":
        target = f"spy://{port}?file={os.devnull}"
    return face(target, **{"timeout": float(timeout), **keywords})
"""

STORM = """
bus = open_bus()
drive = bus.drive(1)

def wait_for_the_dead():
    while True:
        try:
            bus.read({dead}, 0x2100)
        except drivebus.DrivebusError:
            pass

with bus, drive.running(10.0):
    threading.Thread(target=wait_for_the_dead, daemon=True).start()
    say("running")
    while True:
        bus.sleep(1)
"""
"""Runs a motor beside a thread that waits for a dead unit."""


@dataclass
class Line:
    """A line with one drive, and where a program finds it."""

    kind: str
    port: str
    simulator: Simulator

    def commands(self) -> list[int]:
        """What the drive was told."""
        return [command for _, command in self.told()]

    def told(self) -> list[tuple[float, int]]:
        """When it was told what, on the simulator's clock."""
        return [(at, value) for at, address, value in self.simulator.drive(1).writes() if address == CONTROL]

    def asked(self, unit: int) -> int:
        """How often a program asked *unit*, be it there or not."""
        return sum(who == "master" and data[0] == unit for _, who, data in self.simulator.line.trace())

    def runs_on(self) -> bool:
        """Whether the motor is fed, or was not told to stop what it was told last."""
        told = self.commands()
        return self.simulator.drive(1).fault == 0 and bool(told) and told[-1] == FORWARD

    def start(self, body: str, timeout: float = 2.0, before: str = "") -> Program:
        """Runs *body* in a program of its own, which does what stands in *before* before it imports drivebus."""
        child = subprocess.Popen(
            [
                sys.executable,
                "-W",
                "ignore::DeprecationWarning",
                "-c",
                before + PRELUDE + body,
                self.kind,
                self.port,
                str(timeout),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        return Program(child)


def dispositions_as_usual() -> None:
    """Sets back the signals that whoever starts this in the background may have it ignore: programs inherit that."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in ("SIGHUP", "SIGQUIT", "SIGTERM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_DFL)


class Program:
    """One that runs, and what it says."""

    def __init__(self, child: subprocess.Popen[str]) -> None:
        self.child = child

    def __enter__(self) -> Program:
        return self

    def __exit__(self, *_: object) -> None:
        # What a test that failed left behind.
        self.child.kill()
        self.child.communicate()

    def says(self, *words: str) -> None:
        """Waits until it says so."""
        assert self.child.stdout is not None
        for word in words:
            line = self.child.stdout.readline()
            if line != f"{word}\n":
                self.child.kill()
                raise AssertionError((line, *self.child.communicate()))

    def goes_on(self) -> None:
        """Lets it go on where it reads a line."""
        assert self.child.stdin is not None
        self.child.stdin.write("\n")
        self.child.stdin.flush()

    def ends(self, limit: float = 60.0) -> tuple[int, list[str], str]:
        """Waits for its end: the exit code, and what it said since on standard output and standard error."""
        out, said = self.child.communicate(timeout=limit)
        return self.child.returncode, out.splitlines(), said


@contextlib.contextmanager
def line(kind: str, ramp: float = 0.5) -> Iterator[Line]:
    """A line of *kind* with a drive that obeys the bus, and reaches 50 Hz in *ramp* seconds."""
    with Simulator({1: "gd350"}, transport="tcp" if kind in ("socket", "rfc2217") else "pty") as simulator:
        with drivebus.Bus(simulator) as bus:
            drive = bus.drive(1)
            drive.prepare_control()
            drive.write({"P00.11": ramp, "P00.12": ramp})
        if kind == "rfc2217":
            with serial_server(simulator.port) as port:
                yield Line(kind, port, simulator)
        else:
            yield Line(kind, simulator.port, simulator)


@contextlib.contextmanager
def serial_server(port: str) -> Iterator[str]:
    """The URL of a serial server, by RFC 2217 as pyserial has it, for one client and the line at `socket://host:port`."""
    host, number = port.removeprefix("socket://").split(":")
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection((host, int(number))) as behind:

        def serve() -> None:
            client, _ = server.accept()
            with client:
                settings: Any = _Settings()
                writer: Any = _Client(client)
                manager = serial.rfc2217.PortManager(settings, writer)
                answers = threading.Thread(target=hand_on, args=(behind, client, manager.escape))
                answers.start()
                hand_on(client, behind, manager.filter)
                behind.shutdown(socket.SHUT_RDWR)
                answers.join()

        def hand_on(here: socket.socket, there: socket.socket, change: Callable[[bytes], Iterable[bytes]]) -> None:
            with contextlib.suppress(OSError):
                while came := here.recv(1024):
                    there.sendall(b"".join(change(came)))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"rfc2217://127.0.0.1:{server.getsockname()[1]}"
        finally:
            # Where nobody came.
            with contextlib.suppress(OSError), socket.create_connection(server.getsockname(), timeout=1):
                pass
            thread.join()


class _Settings:
    """A serial port as a serial server sees it: it takes every setting."""

    baudrate, bytesize, parity, stopbits = 19200, 8, "E", 1
    cts = dsr = ri = cd = rts = dtr = rtscts = xonxoff = break_condition = False

    def reset_input_buffer(self) -> None: ...
    def reset_output_buffer(self) -> None: ...


class _Client:
    def __init__(self, client: socket.socket) -> None:
        self._client = client

    def write(self, data: bytes) -> None:
        self._client.sendall(data)
