"""A drive that answers 8000H where it has nothing, as an Altivar does: it is told what it is, and is halted.

Altivar 71 integrated Modbus (Schneider 1755863), p. 39: 8000H for each word of a read that is not there. AnHeart,
scripts/bench_console.py, measured it of reads of one word at an ATV320U04M2C.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivebus import Bus

from .odd_slave import on_a_socket
from .serial_server import crc

ETA, RFR, CMD, CHCF = 0x0C81, 0x0C82, 0x2135, 0x20D1
TURNS, STANDS, OFF = 0x0237, 0x0233, 0x0250


def altivar(writes: list[tuple[int, int]]) -> Callable[[bytes], bytes]:
    """What one that turns forward at 30 Hz says; *writes* keeps what is written to it."""
    words = {ETA: TURNS, RFR: 300, CHCF: 1, CMD: 0x000F, 0x2136: 300, 0x0C85: 100}

    def say(request: bytes) -> bytes:
        head, address, last = request[:2], int.from_bytes(request[2:4], "big"), int.from_bytes(request[4:6], "big")
        if head[1] == 3:
            data = b"".join(words.get(address + place, 0x8000).to_bytes(2, "big") for place in range(last))
            body = head + bytes([len(data)]) + data
        elif head[1] == 6:
            writes.append((address, last))
            if address == CMD and last in {0x0000, 0x0007}:
                words.update({ETA: STANDS if last else OFF, RFR: 0})
            body = request[:6]
        else:
            body = bytes([head[0], head[1] | 0x80, 1])
        return body + crc(body)

    return say


@pytest.mark.parametrize("named", ["atv320", "atv71", "atv312", "atv600", "gd350"])
@pytest.mark.parametrize(("command", "word"), [("stop", 0x0007), ("coast", 0x0000)])
def test_it_is_halted_by_its_own_words(named: str, command: str, word: int) -> None:
    writes: list[tuple[int, int]] = []
    with on_a_socket(altivar(writes)) as url, Bus(url, share="never") as bus:
        getattr(bus.drive(1, named, unverified=True), command)()
    assert {*writes} == {(CMD, word)}
