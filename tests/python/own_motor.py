"""A slave in a process of its own, which keeps its own motor: what the motor does is its word, and never drivebus's.

    python -m tests.python.own_motor [tcp [ADDRESS ...]]

It says its port, and then each event as a line of JSON: a request that came, what it did to the motor, and when. It is
a GD350 as far as a stop and a start ask it; every other register holds its own address, so that a wrong value shows
itself. Its ramp takes no time, so that nothing here depends on a clock. On `tcp` it stands behind a serial server that
lets several clients in at once, and tells all of them every answer.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

CONTROL, SETPOINT, STATE, STATUS, DEVICE, OUTPUT = 0x2000, 0x2001, 0x2100, 0x2101, 0x2103, 0x3000
FORWARD, REVERSE, STOP, COAST = 1, 2, 5, 6
STANDS = 3
"""2100H of a motor at rest. Manual of the GD350, communication chapter."""
HALTS = tuple(bytes([6, CONTROL >> 8, CONTROL & 0xFF, 0, code]).hex() for code in (STOP, COAST))


def crc(data: bytes) -> bytes:
    """CRC-16 of Modbus, its low byte first."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


@dataclass
class Slave:
    """Unit 1 and its motor."""

    turns: int = 0
    setpoint: int = 0
    kept: dict[int, int] = field(default_factory=dict)

    def word(self, address: int) -> int:
        """What a register holds now."""
        now = {
            STATE: {1: FORWARD, -1: REVERSE}.get(self.turns, STANDS),
            STATUS: 1 | 2 << 5,  # ready, and commanded by communication
            0x2102: 0,  # no fault
            DEVICE: 0x01A0,
            SETPOINT: self.setpoint,
            OUTPUT: self.setpoint if self.turns else 0,
            0x3001: self.setpoint,
            0x0001: 2,  # P00.01, commands come by communication
            0x0003: 5000,  # P00.03 and P00.04, frequencies at the most
            0x0004: 5000,
            0x0006: 8,  # P00.06, the setpoint comes by communication
        }
        return now.get(address, self.kept.get(address & 0x7FFF, address))

    def write(self, address: int, word: int) -> None:
        if address == SETPOINT:
            self.setpoint = word
        elif address == CONTROL and word in (FORWARD, REVERSE):
            self.turns = 1 if word == FORWARD else -1
        elif address == CONTROL and word in (STOP, COAST):
            self.turns = 0
        elif address != CONTROL:
            self.kept[address & 0x7FFF] = word

    def answer(self, pdu: bytes) -> bytes:
        """What it answers to *pdu*."""
        function = pdu[0]
        if function == 8:
            return pdu
        if function == 3:
            address, count = struct.unpack(">HH", pdu[1:5])
            words = [self.word(address + place) & 0xFFFF for place in range(count)]
            return bytes([3, 2 * count]) + struct.pack(f">{count}H", *words)
        if function == 6:
            self.write(*struct.unpack(">HH", pdu[1:5]))
            return pdu
        if function == 16:
            address, count = struct.unpack(">HH", pdu[1:5])
            # The setpoint before the command: they take effect together.
            for place in reversed(range(count)):
                self.write(address + place, struct.unpack(">H", pdu[6 + 2 * place : 8 + 2 * place])[0])
            return pdu[:5]
        return bytes([function | 0x80, 1])


def frames(held: bytes) -> tuple[list[bytes], bytes]:
    """The requests that are whole in *held*, and the rest. What is damaged is dropped."""
    found: list[bytes] = []
    while len(held) >= 8:
        length = 9 + held[6] if held[1] == 16 else 8
        if len(held) < length:
            break
        frame, held = held[:length], held[length:]
        if crc(frame[:-2]) != frame[-2:]:
            return found, b""
        found.append(frame)
    return found, held


def tell(**event: object) -> None:
    sys.stdout.write(json.dumps({"at": time.monotonic(), **event}) + "\n")
    sys.stdout.flush()


def serve(slave: Slave, frame: bytes) -> bytes | None:
    """What goes out for a request; None where it is somebody else's."""
    if frame[0] not in (0, 1):
        tell(unit=frame[0], pdu=frame[1:-2].hex())
        return None
    answer = slave.answer(frame[1:-2])
    tell(unit=frame[0], pdu=frame[1:-2].hex(), turns=slave.turns)
    return bytes([1]) + answer + crc(bytes([1]) + answer) if frame[0] else None


def on_a_terminal() -> None:
    import tty

    ours, theirs = os.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    print(os.ttyname(theirs), flush=True)
    slave, held = Slave(), b""
    while True:
        came = os.read(ours, 512)
        found, held = frames(held + came)
        for frame in found:
            if (answer := serve(slave, frame)) is not None:
                os.write(ours, answer)


def behind_a_server(addresses: list[str]) -> None:
    first = addresses[0] if addresses else "127.0.0.1"
    doors = [socket.create_server((first, 0), family=socket.AF_INET6 if ":" in first else socket.AF_INET)]
    port = doors[0].getsockname()[1]
    for other in addresses[1:]:
        family = socket.AF_INET6 if ":" in other else socket.AF_INET
        doors.append(socket.create_server((other, port), family=family))
    print(f"socket://{first}:{port}", flush=True)
    slave = Slave()
    held: dict[socket.socket, bytes] = {}
    waiting: list[bytes] = []
    while True:
        # One request at a time is on the line behind it, as long as its characters take at 19200.
        ready, _, _ = select.select([*doors, *held], [], [], 0.0 if waiting else None)
        for one in ready:
            if one in doors:
                client, _ = one.accept()
                client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                held[client] = b""
                tell(clients=len(held))
                continue
            try:
                came = one.recv(512)
            except OSError:
                came = b""
            if not came:
                del held[one]
                one.close()
                tell(clients=len(held))
                continue
            found, held[one] = frames(held[one] + came)
            waiting += found
        if waiting and (answer := serve(slave, waiting.pop(0))) is not None:
            time.sleep(0.012)
            for client in held:
                with contextlib.suppress(OSError):
                    client.send(answer)


class OwnMotor:
    """The slave, for a test: where it is, and what it says."""

    def __init__(self, *how: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.python.own_motor", *how],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[2],
        )
        assert self._process.stdout is not None
        self.port = self._process.stdout.readline().strip()
        self._events: list[dict[str, Any]] = []
        self._came = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._came:
                self._events.append(json.loads(line))
                self._came.notify_all()

    @property
    def events(self) -> list[dict[str, Any]]:
        """What it has said so far."""
        with self._came:
            return list(self._events)

    def until(self, is_it: Callable[[dict[str, Any]], bool], since: int = 0) -> dict[str, Any]:
        """The first event from *since* on that *is_it*, once it is there."""

        def found() -> dict[str, Any] | None:
            return next(filter(is_it, self._events[since:]), None)

        with self._came:
            event = self._came.wait_for(found, timeout=60)
        assert event is not None, self._events[-5:]
        return event

    def is_halted(self, since: int) -> dict[str, Any]:
        """The first halt from *since* on, once it was taken: no motor turns then."""
        return self.until(lambda event: event.get("pdu") in HALTS and event.get("turns") == 0, since)

    @property
    def turns(self) -> bool:
        """Whether the motor turned at its last request."""
        return bool([event["turns"] for event in self.events if "turns" in event][-1])

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        self._reader.join()
        assert self._process.stdout is not None
        self._process.stdout.close()


@contextlib.contextmanager
def own_motor(*how: str) -> Iterator[OwnMotor]:
    """The slave, for as long as the block lasts."""
    slave = OwnMotor(*how)
    try:
        yield slave
    finally:
        slave.close()


if __name__ == "__main__":
    if sys.argv[1:2] == ["tcp"]:
        behind_a_server(sys.argv[2:])
    else:
        on_a_terminal()
