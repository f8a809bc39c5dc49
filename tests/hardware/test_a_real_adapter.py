"""What is promised of adapters, on a real one. Only reads and echoes; a unit on its line helps, and is not needed.

Runs only when asked for:

    DRIVEBUS_PORT=/dev/ttyUSB0 DRIVEBUS_UNIT=1 pytest -m hardware tests/hardware
    DRIVEBUS_RS485=kernel …     where RTS is wired to a transceiver: kernel, rts or auto
"""

from __future__ import annotations

import os

import pytest

import drivebus
from drivebus.doctor import examine
from drivebus.line import port_facts

pytestmark = [
    pytest.mark.hardware,
    pytest.mark.skipif("DRIVEBUS_PORT" not in os.environ, reason="no DRIVEBUS_PORT: which adapter is it?"),
]

PORT = os.environ.get("DRIVEBUS_PORT", "")
UNIT = int(os.environ.get("DRIVEBUS_UNIT", "1"))
BAUD = int(os.environ.get("DRIVEBUS_BAUD", "19200"))


def timer() -> int | None:
    return port_facts.facts(PORT).latency_timer_ms


def test_the_latency_timer_is_least_while_the_port_is_open_and_as_it_was_afterwards() -> None:
    before = timer()
    if before is None:
        pytest.skip("this adapter has no latency timer that Linux knows of")
    with drivebus.Bus(PORT, read_only=True) as bus:
        refused = any("may not change it" in note for note in bus.stats()["notes"])
        assert timer() == (before if refused else 1)
    assert timer() == before
    with drivebus.Bus(PORT, read_only=True, low_latency=False):
        assert timer() == before


@pytest.mark.parametrize("baudrate", [1200, 9600, 10400, 19200, 115200, 187500])
def test_every_speed_is_made_or_refused_with_the_nearest(baudrate: int) -> None:
    refusal = ""
    try:
        drivebus.Bus(PORT, baudrate=baudrate, read_only=True).close()
    except drivebus.PortError as error:
        refusal = str(error)
    assert not refusal or "nearest" in refusal or "does not take" in refusal


def test_a_second_master_is_kept_out() -> None:
    with (
        drivebus.Bus(PORT, read_only=True),
        pytest.raises(drivebus.PortError, match="this program has it open already"),
    ):
        drivebus.Bus(PORT)


@pytest.mark.skipif("DRIVEBUS_RS485" not in os.environ, reason="no DRIVEBUS_RS485: is RTS wired to a transceiver?")
def test_direction_control_loses_no_byte() -> None:
    rs485 = {"mode": os.environ.get("DRIVEBUS_RS485", "")}
    with drivebus.Bus(PORT, baudrate=BAUD, read_only=True, rs485=rs485, retries=0) as bus:
        for _ in range(200):
            assert bus.echo(UNIT) > 0
        assert bus.stats().crc_errors == 0


def test_the_doctor_finds_the_unit_and_nothing_wrong() -> None:
    findings = list(examine(PORT, UNIT, baudrate=BAUD))
    assert [str(finding) for finding in findings if finding.wrong] == []
    assert any(finding.name == "turnaround" for finding in findings)
