"""A pseudo-terminal as a way in: programs that know serial ports alone. Foreign masters, and one by the byte."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import minimalmodbus
import pytest
import serial

import drivebus
from drivebus import Allow, Bus, Gateway, PortError, Simulator

from .tcp_client import seen
from .test_gateway import rtu
from .test_shared_group import GROUP

pytestmark = pytest.mark.skipif(not Path("/dev/ptmx").exists(), reason="no pseudo-terminals")

LOOK, LOOKED = rtu(1, b"\x03\x21\x03\x00\x01"), rtu(1, b"\x03\x02\x01\xa0")


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "plc"


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350", 2: "vfd500"}, transport="process", baudrate=115200) as simulator:
        yield simulator


@pytest.fixture(scope="module")
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator, baudrate=115200) as bus:
        yield bus


@pytest.fixture
def gateway(bus: Bus, link: Path) -> Iterator[Gateway]:
    with Gateway(bus, link, answer_within=20.0) as gateway:
        yield gateway


def opened(link: Path) -> serial.Serial:
    return serial.Serial(str(link), 115200, timeout=20)


def test_a_foreign_master_that_opens_it_again_and_again(gateway: Gateway, link: Path) -> None:
    for _ in range(20):
        master = minimalmodbus.Instrument(str(link), 1, close_port_after_each_call=True)
        master.serial.timeout = 20
        assert master.read_register(0x2103) == 0x01A0
    assert (gateway.stats.answered, gateway.stats.cut_off) == (20, 0)
    assert repr(gateway) == f"<Gateway at {link}>"


def test_drivebus_through_drivebus(gateway: Gateway, link: Path) -> None:
    with Bus(str(link), baudrate=115200, parity="N", timeout=5.0) as other:
        assert other.read(1, 0x2103) == [0x01A0]
        with pytest.raises(drivebus.Refused, match="01H"):
            other.write(1, 0x2000, 1)
    assert gateway.stats.refused >= 1
    assert gateway.stats.written == 0


def test_what_one_program_did_not_take_is_never_the_next_ones(gateway: Gateway, link: Path) -> None:
    """The first asks and goes; its answer has the length of the next one's."""
    other = rtu(1, b"\x03\x21\x04\x00\x01")
    for turn in range(50):
        with opened(link) as first:
            first.write(other)
            seen(lambda turn=turn: gateway.stats.requests > 2 * turn)  # type: ignore[misc]
            if turn % 2:
                seen(lambda: gateway.stats.answered + gateway.stats.failed + gateway.stats.given_up > 0)
        with opened(link) as second:
            second.write(LOOK)
            assert second.read(len(LOOKED)) == LOOKED


def test_what_is_no_frame_is_told_and_what_follows_a_pause_is_heard(gateway: Gateway, link: Path) -> None:
    with opened(link) as program:
        program.write(b"AT+CGMI\r\n" * 40)
        seen(lambda: gateway.stats.cut_off > 0 and gateway.stats.clients == 0)
        told = gateway.told()
        assert told == [f"{link} was cut off: no frame of Modbus RTU, or a CRC that is wrong"]
        program.timeout = 0.1
        came = b""
        while not came:
            program.write(LOOK)
            came = program.read(len(LOOKED))
        assert came == LOOKED


def test_who_closes_it_has_what_it_ran_halted(simulator: Simulator, bus: Bus, link: Path) -> None:
    drive = bus.drive(1, "gd350")
    drive.prepare_control()
    drive.write_setpoint(50.0)
    may_run = Allow(drives=[drive], commands=["run"])
    with Gateway(bus, link, answer_within=20.0, allow=[may_run], dead_man=60.0) as gateway:
        run = rtu(1, b"\x06\x20\x00\x00\x01")
        with opened(link) as program:
            program.write(run)
            assert program.read(len(run)) == run
            assert simulator.drive(1).state == "forward"
        seen(lambda: simulator.drive(1).state == "stopped")
        seen(lambda: gateway.stats.clients == 0)
        assert gateway.stats.halted == 1
        assert f"{link}, which commanded the motor of unit 1, has hung up: the motor is halted" in gateway.told()


def test_whom_it_is_for_and_what_is_left_of_it(bus: Bus, link: Path) -> None:
    link.write_text("a file")
    with pytest.raises(PortError, match="is not a link to a pseudo-terminal; give another name"):
        Gateway(bus, link)
    assert link.read_text() == "a file"
    link.unlink()
    with Gateway(bus, link):
        first = link.readlink()
        assert stat.S_IMODE(first.stat().st_mode) == 0o600
        # As after a service that was killed.
        with Gateway(bus, link):
            assert link.readlink() != first
    assert not link.is_symlink()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a file to a group that is not its own")
def test_the_users_of_a_group_may_open_it(link: Path) -> None:
    with (
        Simulator({1: "gd350"}, transport="pty", baudrate=115200) as simulator,
        Bus(simulator.port, baudrate=115200, group=GROUP) as bus,
        Gateway(bus, link),
    ):
        there = link.stat()
        assert (stat.S_IMODE(there.st_mode), there.st_gid) == (0o660, GROUP)


def test_who_has_it_open_at_the_end_sees_a_hang_up(bus: Bus, link: Path) -> None:
    with Gateway(bus, link, answer_within=20.0) as gateway, opened(link) as program:
        program.write(LOOK)
        assert program.read(len(LOOKED)) == LOOKED
        gateway.close()
        with pytest.raises(serial.SerialException):
            program.read(1)
        assert gateway.stats.clients == 0


def test_a_program_that_takes_no_answer_is_cut_off(link: Path) -> None:
    with (
        Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator,
        Bus(simulator) as bus,
        Gateway(bus, link, answer_within=20.0) as gateway,
        opened(link) as program,
    ):
        reads = rtu(1, b"\x03\x21\x00\x00\x04")
        while not gateway.stats.cut_off:
            asked = gateway.stats.requests
            program.write(reads)
            seen(lambda asked=asked: gateway.stats.requests > asked or gateway.stats.cut_off > 0)  # type: ignore[misc]
            seen(lambda: settled(gateway))
    assert "an answer that was not taken within 1 s" in gateway.told()[0]


def settled(gateway: Gateway) -> bool:
    """Whether nothing that was asked is on its way."""
    now = gateway.stats
    return now.cut_off > 0 or now.answered + now.refused + now.failed + now.given_up >= now.requests
