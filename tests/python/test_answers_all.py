"""A unit that answers every read with the same word, and confirms every write: no drive does, and none is started.

A gateway that fills gaps behaves so, a PLC with a large map, or a damaged drive. The judge is what reached the unit.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import pytest

import drivebus
from drivebus import Bus, Drive, DrivebusError, Profile

from .odd_slave import on_a_socket
from .serial_server import crc

WORDS = (0x1388, 0xA5A5, 0xFFFF)
STARTS: list[Callable[[Drive], object]] = [
    lambda drive: drive.run(10.0),
    lambda drive: drive.run(10.0, unverified=True),
    lambda drive: drive.run(10.0, reverse=True, force=True, unverified=True),
    lambda drive: drive.jog(unverified=True),
]


def answers_all(word: int, writes: list[bytes]) -> Callable[[bytes], bytes]:
    """What such a unit says; *writes* keeps the PDUs of what is written to it."""

    def say(request: bytes) -> bytes:
        unit, function, count = request[0], request[1], int.from_bytes(request[4:6], "big")
        if function in {1, 2}:
            data = bytes([0xFF * (word & 1)]) * -(-count // 8)
            body = bytes([unit, function, len(data)]) + data
        elif function in {3, 4}:
            data = word.to_bytes(2, "big") * count
            body = bytes([unit, function, len(data)]) + data
        else:
            body = request[:6]
            if function != 8:
                writes.append(request[1:])
        return body + crc(body)

    return say


@pytest.mark.parametrize("word", WORDS)
@pytest.mark.parametrize("family", drivebus.profiles())
def test_it_is_not_started_by_the_name_of_any_family(family: str, word: int) -> None:
    profile = Profile.builtin(family)
    if profile.state(word) in {"stopped", "forward", "reverse"}:
        pytest.skip("that is a state of such a drive")
    writes: list[bytes] = []
    with on_a_socket(answers_all(word, writes)) as url, Bus(url, share="never") as bus:
        drive = bus.drive(1, family)
        for start in STARTS:
            with suppress(DrivebusError):
                start(drive)
    assert writes == []
