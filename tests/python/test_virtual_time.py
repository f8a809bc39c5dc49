"""Time is the line's clock: in virtual time, limits and ramps hold to the character, and nobody waits for them.

The last resorts are here too, because they take long where a second is a second.
"""

from __future__ import annotations

import contextlib
import re

import pytest

import drivebus
from drivebus import Bus, Drive, Simulator, State
from drivebus.line.asking import Read, Stamped
from drivebus.line.blocking import BlockingBus
from drivebus.operations import state

CONTROL, FORWARD, STOP, COAST = 0x2000, 1, 5, 6
LOOK = 0.1  # seconds that two reads and the pause between them take at 19200, amply


def commands(simulator: Simulator) -> list[int]:
    return [value for _, address, value in simulator.drive(1).writes() if address == CONTROL]


def test_a_ramp_takes_what_the_drive_is_set_to(virtual_bus: Bus, virtual_drive: Drive) -> None:
    virtual_drive.write("P00.11", 10.0)  # seconds to P00.03 = 50 Hz
    virtual_drive.run(hz=10.0)
    began = virtual_bus.now()
    virtual_drive.wait_for_speed(tolerance=0.0, timeout=60)
    assert virtual_bus.now() - began == pytest.approx(2.0, abs=LOOK)


def test_a_scan_asks_each_unit_once_and_whom_it_finds_for_its_state(virtual: Simulator, virtual_bus: Bus) -> None:
    virtual.advance(2.0)  # first contact is over
    began = virtual_bus.now()
    assert [found.unit for found in virtual_bus.scan(range(1, 12))] == [1, 2]
    assert virtual.line.requests == 11 + 2
    assert virtual_bus.now() - began == pytest.approx(9 * 0.1, abs=2 * LOOK)


def test_waiting_ends_when_the_time_is_up(virtual_bus: Bus, virtual_drive: Drive) -> None:
    virtual_drive.write({"P00.11": 1000.0, "P00.12": 1000.0})
    virtual_drive.run(hz=50.0)
    for wait, message in (
        (virtual_drive.wait_for_speed, "its setpoint was not reached within 30 s"),
        (virtual_drive.wait_until_stopped, "it did not stop within 30 s"),
    ):
        began = virtual_bus.now()
        with pytest.raises(drivebus.Unconfirmed, match=message):
            wait(timeout=30)
        assert virtual_bus.now() - began == pytest.approx(30.0, abs=LOOK)


def test_a_command_that_has_no_effect_is_unconfirmed(
    virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive
) -> None:
    # Commands from a bus that is not this one: the state words say "communication", and the drive does not obey.
    virtual_drive.write("P00.02", 1, unverified=True)
    began = virtual_bus.now()
    with pytest.raises(drivebus.Unconfirmed, match=r"run forward was sent to unit 1.*stopped"):
        virtual_drive.run(hz=10.0, confirm=2.0)
    assert virtual_bus.now() - began == pytest.approx(2.0, abs=2 * LOOK)
    virtual_drive.run(hz=10.0, confirm=0)
    assert virtual.drive(1).state == "stopped"


def test_a_motor_that_does_not_turn_round_is_told(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.run(hz=10.0)
    virtual_drive.wait_for_speed(timeout=60)
    virtual_drive.write("P00.02", 1, unverified=True)  # as above: the next command has no effect
    with pytest.raises(drivebus.Unconfirmed, match=r"run reverse was sent to unit 1.*forward"):
        virtual_drive.run(hz=10.0, reverse=True)
    assert virtual.drive(1).state == "forward"


def test_a_trip_instead_of_a_start_is_told_at_once(virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive) -> None:
    virtual.drive(1).load = 4.0
    virtual_drive.write("P00.11", 0.1)
    began = virtual_bus.now()
    with pytest.raises(drivebus.Unconfirmed, match=r"run forward was sent.*OL1"):
        virtual_drive.run(hz=50.0, confirm=60.0)
    assert virtual_bus.now() - began < 30.0
    assert commands(virtual) == [FORWARD]


def test_a_motor_that_cannot_be_stopped_is_told_to_stop_again_and_then_to_coast(
    virtual: Simulator, virtual_drive: Drive
) -> None:
    with pytest.raises(drivebus.Unconfirmed, match="coast"), virtual_drive.running(hz=5.0):
        virtual.line.drop_answers(1000)
    left = next(at for at, _, code in virtual.drive(1).writes() if code == STOP)
    assert commands(virtual)[:9] == [FORWARD, STOP, STOP, STOP, COAST, STOP, STOP, STOP, COAST]
    assert commands(virtual).count(FORWARD) == 1
    # Ten seconds, one frame in 0.15 s at the most, and three attempts more of one frame each.
    assert 10.0 / 0.15 <= len(commands(virtual)) - 1 <= 10.0 / 0.1 + 4
    # After each it was asked for its state, by the bus's own time-out.
    assert 10.0 <= virtual_drive.bus.now() - left <= 16.0


def test_a_stop_that_cannot_be_sent_says_what_the_motor_may_do(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.run(hz=5.0)
    virtual.line.unplug()
    with pytest.raises(drivebus.PortError, match=r"stop could not be sent to .*the motor may still turn") as lost:
        virtual_drive.stop()
    assert lost.value.started is None
    assert commands(virtual) == [FORWARD]


def test_the_first_error_is_kept_when_stopping_fails_too(virtual: Simulator, virtual_drive: Drive) -> None:
    def fail() -> None:
        virtual.line.drop_answers(1000)
        raise RuntimeError("inside")

    with pytest.raises(RuntimeError, match="inside") as reason, virtual_drive.running(hz=5.0):
        fail()
    sent = r"unit 1 could not be stopped: stop or coast was sent to unit 1 \d+ times"
    notes = getattr(reason.value, "__notes__", None)  # Python 3.10 has no notes
    assert notes is None or re.search(sent, notes[0])
    assert commands(virtual)[-1] == COAST


def test_a_start_that_is_refused_and_taken_is_stopped(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual.drive(1).refuse(5, asked="writes", taken=True, count=1)
    with pytest.raises(drivebus.Unconfirmed, match=r"refused.*and yet it turns"), virtual_drive.running(hz=5.0):
        pytest.fail("the block must not be entered")
    assert (virtual.drive(1).state, commands(virtual)) == ("stopped", [FORWARD, STOP])


def test_a_start_that_is_not_confirmed_is_stopped(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.write("P00.02", 1, unverified=True)
    with pytest.raises(drivebus.Unconfirmed), virtual_drive.running(hz=5.0):
        pytest.fail("the block must not be entered")
    assert commands(virtual) == [FORWARD, STOP]


def test_a_start_that_was_not_sent_is_not_stopped(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.run(hz=5.0)
    virtual.line.drop_answers(1000)
    with pytest.raises(drivebus.NoAnswer), virtual_drive.running(hz=10.0):
        pytest.fail("the block must not be entered")
    assert commands(virtual) == [FORWARD], "a motor that somebody else runs is left alone"


def test_a_state_nobody_knows_is_not_a_stop(virtual_drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    virtual_drive.run(hz=5.0)
    ask = BlockingBus.ask_stamped

    async def nobody_knows(bus: BlockingBus, request: Read) -> Stamped:
        came = await ask(bus, request)
        return came._replace(words=[0x00FF, *came.words[1:]]) if request.address == 0x2100 else came

    monkeypatch.setattr(BlockingBus, "ask_stamped", nobody_knows)
    monkeypatch.setattr(state, "state_of", lambda *_: State.UNKNOWN)
    with pytest.raises(drivebus.Unconfirmed, match=r"stop was sent to unit 1.*unknown"):
        virtual_drive.stop()
    with pytest.raises(drivebus.Unconfirmed, match="it did not stop"):
        virtual_drive.wait_until_stopped(timeout=30)


def test_a_motor_that_turns_is_not_jogged(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.run(hz=5.0)
    with pytest.raises(drivebus.NotAllowed, match="turns already"):
        virtual_drive.jog()
    assert commands(virtual) == [FORWARD]


def test_an_hour_is_nothing(virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive) -> None:
    with virtual_drive.running(hz=10.0):
        virtual_bus.sleep(3600)
        assert virtual_drive.status().state is State.FORWARD
    virtual.advance(3600)
    assert virtual.now() > 7200
    assert virtual_drive.status().state is State.STOPPED


def test_a_refused_look_does_not_make_a_command_refused(virtual: Simulator, virtual_drive: Drive) -> None:
    virtual_drive.run(hz=5.0)
    # The stop's own answer, as it is; then a refusal of the look at the state. GD350 manual, chapter 9.4.7.
    virtual.line.answer_with(bytes.fromhex("01 06 20 00 00 05 42 09"))
    refusal = bytes.fromhex("01 83 06 C1 32")
    virtual.line.answer_with(refusal)
    virtual_drive.stop()
    assert [data for _, who, data in virtual.line.trace() if who == "unit"].count(refusal) == 1
    assert commands(virtual) == [FORWARD, STOP]


def test_no_motor_starts_over_a_line_that_loses_answers(
    virtual: Simulator, virtual_bus: Bus, virtual_drive: Drive
) -> None:
    virtual.line.set_faults(silence=0.5)
    for _ in range(5):
        with contextlib.suppress(drivebus.DrivebusError):
            virtual_drive.status()
    assert virtual_bus.link(1).failed > 1
    with pytest.raises(drivebus.NotAllowed, match="the link to unit 1 is bad"):
        virtual_drive.run(hz=5.0)
    assert commands(virtual) == []
    virtual.line.clear()
    virtual_drive.run(hz=5.0)
    assert commands(virtual) == [FORWARD], "ten looks have proved it"
    assert virtual_bus.link(1) == drivebus.Link(10, 10)
