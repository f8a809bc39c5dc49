"""What the simulator promises, a real drive is held to. Only asks; nothing here writes or moves anything.

Runs only when asked for, and takes the line from the environment, as the command line does:

    DRIVEBUS_PORT=/dev/ttyUSB0 DRIVEBUS_UNIT=1 pytest -m hardware tests/hardware
"""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

import drivebus

pytestmark = [
    pytest.mark.hardware,
    pytest.mark.skipif("DRIVEBUS_PORT" not in os.environ, reason="no DRIVEBUS_PORT: which line is it on?"),
]

UNIT = int(os.environ.get("DRIVEBUS_UNIT", "1"))


@pytest.fixture
def bus() -> Iterator[drivebus.Bus]:
    baudrate = int(os.environ.get("DRIVEBUS_BAUD", "19200"))
    bits, parity, stop = os.environ.get("DRIVEBUS_FORMAT", "8E1")
    with drivebus.Bus(
        os.environ["DRIVEBUS_PORT"],
        baudrate=baudrate,
        bytesize=int(bits),
        parity=parity,
        stopbits=int(stop),
        read_only=True,
    ) as bus:
        yield bus


def test_it_returns_an_echo(bus: drivebus.Bus) -> None:
    assert bus.echo(UNIT, 0x12AB) > 0


def test_it_says_what_it_is(bus: drivebus.Bus) -> None:
    assert bus.drive(UNIT).profile.name in drivebus.profiles()


def test_it_has_a_state_and_every_monitor_register(bus: drivebus.Bus) -> None:
    drive = bus.drive(UNIT)
    assert drive.status().state is not drivebus.State.UNKNOWN
    snapshot = drive.monitor()
    assert len(snapshot) == len(drive.profile.monitor_names())


def test_it_refuses_what_the_manual_says_it_refuses(bus: drivebus.Bus) -> None:
    with pytest.raises(drivebus.Refused) as refused:
        bus.read(UNIT, 0x6300)  # P99.00: closed
    assert refused.value.code == 2


def test_a_thousand_reads_on_a_clean_line(bus: drivebus.Bus) -> None:
    for _ in range(1000):
        assert len(bus.read(UNIT, 0x3000, 16)) == 16
    assert bus.stats().crc_errors == 0
