"""What a line that loses, delays and adds costs the caller: the same on every kind of line.

Faults by rate are in test_faults.py; here each one is ordered, and what comes of it is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

import drivebus
from drivebus import Bus, Drive, NoAnswer, Simulator, Unconfirmed

CONTROL, ACCELERATION, RAM = 0x2000, 0x000B, 0x8000
FORWARD, STOP = 1, 5


def commands(simulator: Simulator, unit: int = 1) -> list[int]:
    """The command words that the drive took."""
    return [value for _, address, value in simulator.drive(unit).writes() if address == CONTROL]


def test_a_lost_answer_is_asked_for_again(simulator: Simulator, bus: Bus) -> None:
    simulator.line.drop_answers(1)
    assert bus.read(1, 0x2103) == [0x01A0]
    # Behind a port another may be late on a busy machine.
    assert bus.stats().timeouts == 1 or (bus.stats().timeouts > 1 and simulator.transport != "process")


def test_a_stop_whose_confirmation_is_lost_is_sent_again(simulator: Simulator, obedient: Drive) -> None:
    obedient.run(5.0)
    simulator.line.drop_answers(1)
    obedient.stop()
    sent = commands(simulator)
    # Behind a port another confirmation may be late on a busy machine.
    assert sent == [FORWARD, STOP, STOP] or (set(sent[1:]) == {STOP} and simulator.transport != "process")
    assert sent.count(FORWARD) == 1


def test_one_that_is_sent_for_no_time_is_sent_once(simulator: Simulator, obedient: Drive) -> None:
    obedient.run(5.0)
    simulator.line.drop_answers(1)
    with pytest.raises(drivebus.Unconfirmed) as unknown:
        obedient.stop(within=0)
    assert commands(simulator) == [FORWARD, STOP]
    assert isinstance(unknown.value.__cause__, drivebus.NoAnswer)
    assert unknown.value.request == bytes.fromhex("01 06 20 00 00 05 42 09")


def test_a_stop_is_sent_to_a_drive_that_seems_deaf(simulator: Simulator, obedient: Drive) -> None:
    obedient.run(hz=5.0)
    simulator.line.drop_answers(1000)
    with pytest.raises(NoAnswer):
        obedient.status()
    written = simulator.drive(1).writes()
    with pytest.raises(NoAnswer):
        obedient.setpoint = 10.0
    assert simulator.drive(1).writes() == written, "the drive was looked at, in vain, and nothing was written"
    with pytest.raises(Unconfirmed):
        obedient.stop(within=0)
    simulator.line.clear()
    obedient.wait_until_stopped(timeout=20)
    assert [value for _, address, value in simulator.drive(1).writes() if address == 0x2000] == [1, 5]


def test_a_late_answer_is_never_taken_for_another(simulator: Simulator, bus: Bus, timeout: float) -> None:
    bus.read(1, 0x2103)  # now it is known that nothing echoes, and the next request is the write itself
    simulator.line.delay_answers(1.2 * timeout, 1)
    with pytest.raises(drivebus.NoAnswer):
        bus.write(1, RAM | ACCELERATION, 111)
    assert bus.read(1, 0x2103) == [0x01A0]
    assert bus.read(1, ACCELERATION) == [111]


def test_noise_around_an_answer_is_skipped(simulator: Simulator, bus: Bus) -> None:
    simulator.line.noise_before(b"\x00\xff", 1)
    assert bus.read(1, 0x2103) == [0x01A0]
    simulator.line.noise_after(b"\x00", 1)
    assert bus.read(1, 0x2103) == [0x01A0]
    assert bus.read(1, 0x2100, 1) == [3]


def test_statistics_count_what_happened(simulator: Simulator, bus: Bus) -> None:
    bus.read(1, 0x2103)
    with pytest.raises(drivebus.Refused):
        bus.read(2, 0x6300)
    stats = bus.stats()
    assert stats.requests >= 2
    # Where another master may be, a unit is first read in another length, too, which it may refuse.
    assert stats.refusals == 1 + stats.units[1].refusals
    assert stats.units[1].refusals == (1 if simulator.transport == "tcp" else 0)
    assert stats.units[1].answers >= 1
    assert stats.units[2].refusals == 1
    assert stats["refusals"] == stats.refusals
    assert stats.hints == []


def test_statistics_say_what_noise_means(simulator: Simulator, bus: Bus) -> None:
    simulator.line.noise_before(b"\x00", 100)
    for _ in range(10):
        bus.read(1, 0x2103)
    [hint] = bus.stats().hints
    assert hint.startswith("line: ")
    assert "bias" in hint


class TestBehindAGateway:
    """0BH: it passed the request on, and heard no answer. The unit may have acted. Modbus V1.1b3, section 7."""

    @staticmethod
    def loses(simulator: Simulator, monkeypatch: pytest.MonkeyPatch, address: int) -> None:
        """From now on the gateway hears no answer to a write to *address*."""
        write = Bus.write

        def unheard(bus: Bus, unit: int, place: int, value: int | Sequence[int], /, **how: Any) -> None:
            if place == address:
                body = bytes([unit, 0x86 if isinstance(value, int) else 0x90, 0x0B])
                simulator.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))
            write(bus, unit, place, value, **how)

        monkeypatch.setattr(Bus, "write", unheard)

    def test_a_start_is_not_refused_and_its_block_stops_the_motor(
        self, virtual: Simulator, virtual_drive: Drive, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        self.loses(virtual, monkeypatch, CONTROL)
        with (
            pytest.raises(
                Unconfirmed, match=r"run forward was sent.*the motor may turn.*State seen afterwards: forward"
            ),
            virtual_drive.running(5.0),
        ):
            raise AssertionError("the block is not entered")
        # Each stop was heard as well, and its answer lost: nobody knows before the state shows it.
        assert commands(virtual)[:2] == [FORWARD, STOP]
        assert not virtual_drive.state().running

    def test_a_value_is_cleared_up_by_reading(
        self, virtual: Simulator, virtual_drive: Drive, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        virtual_drive.write("P00.12", 2.0)
        virtual.drive(1).take_writes()
        self.loses(virtual, monkeypatch, RAM | ACCELERATION)
        virtual_drive.write("P00.11", 2.0)
        assert [address for _, address, _ in virtual.drive(1).writes()] == [RAM | ACCELERATION]

    def test_a_read_is_asked_again(self, virtual: Simulator, virtual_bus: Bus) -> None:
        virtual_bus.echo(1)
        body = bytes([1, 0x83, 0x0B])
        virtual.line.answer_with(body + drivebus.crc16(body).to_bytes(2, "little"))
        assert virtual_bus.read(1, 0x2103) == [0x01A0]
        assert virtual_bus.stats().timeouts == 1
        assert virtual_bus.link(1).failed == 1
