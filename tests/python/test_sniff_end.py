"""The end of listening loses nothing: neither what waits for the frame behind it, nor what is still on its way."""

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
from drivebus.capture import read

if os.name == "nt":
    pytest.skip("no pseudo-terminals", allow_module_level=True)

import fcntl
import struct
import termios
import tty


def framed(body: str) -> bytes:
    data = bytes.fromhex(body)
    return data + drivebus.crc16(data).to_bytes(2, "little")


READ, ANSWER = framed("01 03 21 00 00 01"), framed("01 03 02 00 03")
AGAIN = READ + READ + ANSWER
"""Asked again, and answered. To which of the two that belongs, what follows tells: it is waited for up to a second."""


@pytest.fixture
def line() -> Iterator[tuple[int, int, str]]:
    """A pseudo-terminal that nobody answers on: both ends, and the name of the one that is listened to."""
    other, ours = os.openpty()
    tty.setraw(other)
    tty.setraw(ours)
    yield other, ours, os.ttyname(ours)
    os.close(other)
    os.close(ours)


def unread(end: int) -> int:
    """How many bytes wait at *end*."""
    return int(struct.unpack("i", fcntl.ioctl(end, termios.FIONREAD, b"\0" * 4))[0])


def test_who_stops_listening_is_told_what_was_heard_until_then(line: tuple[int, int, str]) -> None:
    said = READ + ANSWER + AGAIN
    other, _, port = line
    stop, came = threading.Event(), bytearray()

    def tap(_at: float, data: bytes) -> None:
        came.extend(data)
        if len(came) == len(said):
            stop.set()

    with drivebus.Bus(port, parity="N", read_only=True) as bus:
        listening = drivebus.sniff(bus, tap=tap, stop=stop)
        os.write(other, READ + ANSWER)
        first = next(listening)
        os.write(other, AGAIN)
        rest = list(listening)
    assert [(each.request, each.answer) for each in (first, *rest)] == [(READ, ANSWER), (READ, None), (READ, ANSWER)]


def test_what_came_while_nobody_took_it_is_told_too(line: tuple[int, int, str]) -> None:
    """A listener that is slow, such as a terminal, has bytes waiting when it is stopped."""
    other, _, port = line
    stop = threading.Event()
    with drivebus.Bus(port, parity="N", read_only=True) as bus:
        listening = drivebus.sniff(bus, stop=stop)
        os.write(other, READ + ANSWER)
        assert next(listening).answer == ANSWER
        for number in range(2, 22):
            os.write(other, READ + ANSWER)
            # Whether it is taken off the port the port does not say: a pseudo-terminal hands on later what was written.
            while bus.stats().late_replies < 2 * number:
                pass
        stop.set()
        rest = list(listening)
    assert [each.answer for each in rest] == [ANSWER] * 20


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_command_and_its_capture_has_all(
    line: tuple[int, int, str], tmp_path: Path, number: signal.Signals
) -> None:
    other, ours, port = line
    path = tmp_path / "heard.pcapng"
    words = [sys.executable, "-m", "drivebus", "-f", "8N1", "sniff", port, "-w", str(path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stderr.readline().startswith("Listening on ")
        os.write(other, READ + ANSWER)
        shown = [process.stdout.readline()]
        os.write(other, AGAIN)
        while unread(ours):
            pass
        process.send_signal(number)
        shown += process.stdout.readlines()
        assert process.stderr.readline() == "3 requests to 1 unit, 2 answered.\n"
    assert process.returncode == 0
    assert [each.data for each in read(path)] == [READ, ANSWER, READ, READ, ANSWER]
    assert [" -> " in each for each in shown] == [True, True, True]
