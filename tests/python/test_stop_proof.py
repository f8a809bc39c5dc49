"""What proves that a stop works: standstill, or a fall that began with the stop and goes along the drive's own ramp.

A frequency also falls to a lower setpoint, in a reversal, and to the jog frequency after a jog that caught a motor
which turned. A drive that confirms a stop and does not obey it (its commands come by another bus, say: P00.02) must not
pass for one that stops. Ramps and jog of the simulated GD350: 10 s for 50 Hz, and 5 Hz. `test_stop_explained` has more
that makes a frequency fall.
"""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, Simulator, State, Unconfirmed

COMMAND, STATE, FREQUENCY, CODE = 0x2000, 0x2100, 0x3000, 0x2103
STOP, COAST = 5, 6
SETTINGS = [0x0001, 0x0006, 0x000C]
"""Where P00.01 to P00.03, P00.06 and P00.12 are read."""
OTHER_BUS = {"P00.02": 1}
"""The drive takes the words, and does nothing by them; its status words still say communication."""


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(simulator: Simulator) -> Iterator[Drive]:
    with Bus(simulator, timeout=0.25) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        yield drive


def commands(simulator: Simulator) -> list[int]:
    return [word for _, address, word in simulator.drive(1).writes() if address == COMMAND]


def asked_after(simulator: Simulator, command: int) -> list[int]:
    """The addresses that were read after *command* was written last."""
    frames = [frame for _, who, frame in simulator.line.trace() if who == "master"]
    last = max(at for at, frame in enumerate(frames) if frame[1:6] == bytes([6, 0x20, 0, 0, command]))
    return [int.from_bytes(frame[2:4], "big") for frame in frames[last + 1 :]]


def a_second(drive: Drive) -> Drive:
    """The same unit on the same line, by who knows nothing of the first."""
    return Drive(drive.bus, drive.unit, drive.profile, 0x01A0)


def at_speed(drive: Drive, hz: float = 50.0) -> None:
    drive.run(hz)
    drive.wait_for_speed(timeout=30)


class TestTheUsualCase:
    """What it is was asked more than ten seconds before, and so once more behind the proof."""

    @pytest.mark.parametrize("reverse", [False, True])
    def test_a_stop_from_its_speed_is_proved_by_half_a_second_of_its_ramp(
        self, simulator: Simulator, drive: Drive, reverse: bool
    ) -> None:
        """And by how the drive is set: P00.01, P00.02, P00.03, P00.06 and P00.12."""
        drive.run(50.0, reverse=reverse)
        drive.wait_for_speed(timeout=30)
        begun = drive.bus.now()
        drive.stop()
        assert 0.5 < drive.bus.now() - begun < 0.75
        asked = asked_after(simulator, STOP)
        looks = len(asked) - len(SETTINGS) - 1
        assert asked == [*[STATE, FREQUENCY] * (looks // 2), *SETTINGS, CODE]
        assert drive.state() is (State.REVERSE if reverse else State.FORWARD)

    def test_a_stop_that_who_knows_nothing_of_the_start_gives(self, simulator: Simulator, drive: Drive) -> None:
        """As `drivebus stop` in another terminal."""
        at_speed(drive)
        a_second(drive).stop()
        assert simulator.drive(1).frequency > 46.0

    def test_a_stop_while_it_gets_faster(self, drive: Drive) -> None:
        """At no setpoint: when its fall began, nobody knows."""
        drive.run(50.0)
        drive.bus.sleep(2.0)
        drive.stop()
        assert drive.state() is State.STOPPED

    @pytest.mark.parametrize("reverse", [False, True])
    def test_the_end_of_a_jog(self, drive: Drive, reverse: bool) -> None:
        drive.jog(reverse=reverse)
        drive.bus.sleep(3.0)
        drive.jog_stop()
        assert drive.state() is State.STOPPED

    def test_a_coast_is_off_at_once(self, simulator: Simulator, drive: Drive) -> None:
        at_speed(drive)
        drive.coast()
        assert asked_after(simulator, COAST) == [STATE, CODE]

    def test_a_stop_of_what_stands(self, simulator: Simulator, drive: Drive) -> None:
        drive.stop()
        assert asked_after(simulator, STOP) == [STATE]

    def test_where_the_setpoint_in_force_is_in_percent(self, simulator: Simulator, tmp_path: Path) -> None:
        """It says nothing of a frequency then."""
        (tmp_path / "profile.toml").write_text(
            'name = "ours"\nsource = "Ours"\n[overlay]\nprofile = "gd350"\n', encoding="utf-8"
        )
        (tmp_path / "registers.csv").write_text(
            "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n"
            "0x3001,set_frequency_actual,Setpoint in force,%,1000,no,0.000,60.000,,ro,yes,,Ours\n",
            encoding="utf-8",
        )
        with Bus(simulator, timeout=0.25) as bus:
            drive = bus.drive(1, tmp_path)
            drive.prepare_control()
            drive.run(50.0)
            drive.wait_for_speed(50.0, timeout=30)
            drive.stop()
            assert drive.state() is State.STOPPED


class TestAFallThatProvesNothing:
    def test_a_reversal_under_way(self, simulator: Simulator, drive: Drive) -> None:
        """It passes through zero along the very ramp, and goes on."""
        at_speed(drive, 30.0)
        drive.run(30.0, reverse=True)
        drive.write(OTHER_BUS, unverified=True)
        with pytest.raises(Unconfirmed, match=r"stop was sent.*the motor may still turn.*reverse"):
            drive.stop()
        drive.bus.sleep(30.0)
        drive.state()
        assert simulator.drive(1).frequency == -30.0

    @pytest.mark.parametrize("who", ["the same", "another"])
    def test_a_reversal_of_a_drive_that_is_set_as_it_should_be(
        self, drive: Drive, monkeypatch: pytest.MonkeyPatch, who: str
    ) -> None:
        """It confirms the stop, and nothing that it says speaks against it."""
        at_speed(drive, 30.0)
        drive.run(30.0, reverse=True)
        hear = drive.bus.write
        ignored: list[object] = []

        def ignore_stops(unit: int, address: int, value: object, **how: Any) -> None:
            if (address, value) == (COMMAND, STOP):
                ignored.append(drive.bus.read(unit, STATE))
            else:
                hear(unit, address, value, **how)  # type: ignore[arg-type]

        teller = drive if who == "the same" else a_second(drive)
        monkeypatch.setattr(drive.bus, "write", ignore_stops)
        with pytest.raises(Unconfirmed, match=r"stop was sent.*the motor may still turn.*reverse"):
            teller.stop()
        assert len(ignored) == 1

    def test_the_end_of_a_block_goes_on_to_coast(self, simulator: Simulator, drive: Drive) -> None:
        at_speed(drive, 30.0)
        with pytest.raises(Unconfirmed, match=r"coast was sent"), drive.running(30.0, reverse=True):
            drive.write(OTHER_BUS, unverified=True)
        assert commands(simulator)[-4:] == [STOP, STOP, STOP, COAST]

    def test_a_jog_that_caught_the_motor(self, simulator: Simulator, drive: Drive) -> None:
        """It slows down to the jog frequency, and would jog there for ever."""
        at_speed(drive)
        drive.coast()
        drive.jog()
        drive.write(OTHER_BUS, unverified=True)
        with pytest.raises(Unconfirmed, match=r"stop was sent.*the motor may still turn.*forward, at 5 Hz"):
            drive.stop()
        assert drive.state() is State.FORWARD
        assert commands(simulator).count(STOP) == 1

    def test_a_lower_setpoint(self, simulator: Simulator, drive: Drive) -> None:
        at_speed(drive)
        drive.setpoint = 10.0
        drive.bus.sleep(0.5)
        drive.write(OTHER_BUS, unverified=True)
        with pytest.raises(Unconfirmed, match=r"forward, at 10 Hz"):
            drive.stop()
        assert commands(simulator).count(STOP) == 1

    def test_a_lower_setpoint_of_a_motor_that_is_caught(self, drive: Drive) -> None:
        at_speed(drive)
        drive.coast()
        drive.run(10.0)
        drive.write(OTHER_BUS, unverified=True)
        with pytest.raises(Unconfirmed, match=r"forward, at 10 Hz"):
            drive.stop()

    def test_the_end_of_a_jog_of_a_motor_that_runs(self, drive: Drive) -> None:
        """Command 8 ends nothing but a jog."""
        at_speed(drive)
        drive.setpoint = 10.0
        drive.bus.sleep(0.5)
        with pytest.raises(Unconfirmed, match=r"jog stop was sent.*forward, at 10 Hz"):
            drive.jog_stop()

    def test_a_coast_that_is_not_obeyed(self, drive: Drive) -> None:
        """What coasts is off at once: that its frequency falls proves nothing."""
        at_speed(drive)
        drive.setpoint = 10.0
        drive.write(OTHER_BUS, unverified=True)
        with pytest.raises(Unconfirmed, match=r"coast was sent.*may still be powered.*forward, at 10 Hz"):
            drive.coast()

    def test_a_speed_that_wobbles(self, drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
        """As under vector control: some hundredths of a hertz up and down, at each look."""
        at_speed(drive)
        drive.write(OTHER_BUS, unverified=True)
        read, wobble = drive.bus.read, itertools.cycle([3, -2, 2, -3])

        def wobbling(unit: int, address: int, *rest: int, **how: Any) -> list[int]:
            words = read(unit, address, *rest, **how)
            return [words[0] + next(wobble), *words[1:]] if address == FREQUENCY else words

        monkeypatch.setattr(drive.bus, "read", wobbling)
        with pytest.raises(Unconfirmed, match=r"the motor may still turn.*forward, at \d+(\.\d+)? Hz"):
            drive.stop()

    def test_a_drive_that_obeys_its_keypad(self, drive: Drive) -> None:
        """Its speed then comes from there: whoever stands at it may slow it down."""
        at_speed(drive, 40.0)
        drive.write("P00.10", 20.0, unverified=True)
        drive.write({"P00.06": 0, "P00.01": 0}, unverified=True)
        with pytest.raises(Unconfirmed, match="with commands from the keypad"):
            drive.stop()

    def test_a_coast_that_is_not_obeyed_while_a_stop_ends(self, drive: Drive) -> None:
        """Below its setpoint too: what falls is the ramp of the stop, and the motor is fed until that has ended."""
        at_speed(drive, 20.0)
        drive.stop()
        drive.write(OTHER_BUS, unverified=True)
        drive.coast()
        assert drive.state() is State.STOPPED

    def test_what_somebody_at_the_keypad_slows_down(self, drive: Drive) -> None:
        at_speed(drive, 20.0)
        drive.stop()
        drive.write("P00.01", 0, unverified=True)
        drive.stop()
        assert drive.state() is State.STOPPED


class TestAStopThatWorksMeanwhile:
    """It passes, only later: where the fall may have another reason, it is looked at until the motor stands."""

    @pytest.mark.parametrize("setpoint", [45.0, 10.0])
    def test_under_a_lower_setpoint(self, drive: Drive, setpoint: float) -> None:
        """The ramp from 50 Hz takes 10 s, and `confirm` is 1 s: it is no failure while it falls."""
        at_speed(drive)
        drive.setpoint = setpoint
        drive.bus.sleep(0.1)
        drive.stop()
        assert drive.state() is State.STOPPED

    def test_of_a_motor_that_turns_round(self, drive: Drive) -> None:
        at_speed(drive, 30.0)
        drive.run(30.0, reverse=True)
        drive.stop()
        assert drive.state() is State.STOPPED

    def test_out_of_a_jog_that_caught_the_motor(self, drive: Drive) -> None:
        at_speed(drive)
        drive.coast()
        drive.jog()
        drive.stop()
        assert drive.state() is State.STOPPED

    def test_at_the_end_of_a_block(self, simulator: Simulator, drive: Drive) -> None:
        """Neither a second stop, nor a coast."""
        with drive.running(50.0):
            drive.wait_for_speed(timeout=30)
            drive.setpoint = 10.0
        assert [word for word in commands(simulator) if word in (STOP, COAST)] == [STOP]

    def test_both_faces_look_alike(self, simulator: Simulator, drive: Drive) -> None:
        async def main(other: Simulator) -> list[Any]:
            async with drivebus.aio.Bus(other, timeout=0.25) as bus:
                drive = await bus.drive(1)
                await drive.prepare_control()
                await drive.run(50.0)
                await drive.wait_for_speed(timeout=30)
                await drive.write_setpoint(45.0)
                await drive.stop()
            return asked_after(other, STOP)

        at_speed(drive)
        drive.setpoint = 45.0
        drive.stop()
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as other:
            assert asyncio.run(main(other)) == asked_after(simulator, STOP)


class TestABlockThatDidNotStartTheMotor:
    """What somebody else runs is not stopped by a block that ended before its own start was sent."""

    @pytest.mark.parametrize("reason", [KeyboardInterrupt, SystemExit, drivebus.NoAnswer])
    @pytest.mark.parametrize("block", ["running", "jogging"])
    def test_it_goes_on(
        self,
        simulator: Simulator,
        drive: Drive,
        monkeypatch: pytest.MonkeyPatch,
        reason: type[BaseException],
        block: str,
    ) -> None:
        at_speed(drive, 10.0)

        def interrupted(*_: object, **__: object) -> None:
            raise reason("while it is looked at")

        with monkeypatch.context() as meanwhile:
            meanwhile.setattr(drive.bus, "read_stamped", interrupted)
            with pytest.raises(reason), getattr(drive, block)():
                pytest.fail("it was not started")
        assert [word for word in commands(simulator) if word in (STOP, COAST, 8)] == []
        assert drive.state() is State.FORWARD

    def test_what_may_have_been_sent_is_ended(
        self, simulator: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        write = drive.bus.write

        def interrupted(*what: Any, **how: Any) -> None:
            write(*what, **how)
            if what[1] == COMMAND and what[2] == 1:
                raise KeyboardInterrupt

        monkeypatch.setattr(drive.bus, "write", interrupted)
        with pytest.raises(KeyboardInterrupt), drive.running():
            pytest.fail("it was not started")
        assert commands(simulator)[-1] == STOP

    def test_the_same_where_it_is_awaited(self, simulator: Simulator, drive: Drive) -> None:
        async def main() -> None:
            async with drivebus.aio.Bus(simulator, timeout=0.25) as bus:
                other = await bus.drive(1)
                task = asyncio.ensure_future(block(other))
                await asyncio.sleep(0)  # it has asked its first question, and waits for the answer
                task.cancel()
                await asyncio.gather(task, return_exceptions=True)
                assert task.cancelled()

        async def block(other: drivebus.aio.Drive) -> None:
            async with other.running(20.0):
                pytest.fail("it was not started")

        at_speed(drive, 10.0)
        asyncio.run(main())
        assert [word for word in commands(simulator) if word in (STOP, COAST)] == []


class TestAMotorThatRunsInAFault:
    """A VFD500 that keeps running in a fault: bits 0 and 3 of status word 1, 3 in bits 5 and 4 (its manual, p. 96)."""

    COMMANDS, STATUS = 0x7000, 0x1B12
    RUNS_ON = 0x0039

    @pytest.fixture
    def drive(self, monkeypatch: pytest.MonkeyPatch) -> Iterator[Drive]:
        """It runs at 30 Hz, and ignores what it is told unless a test says otherwise."""
        with Simulator({1: "vfd500"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            drive = bus.drive(1, "vfd500", unverified=True, variants={"speed_unit": "Hz"})
            drive.prepare_control(store=True)
            drive.run(30.0)
            drive.wait_for_speed(30.0, timeout=60)
            read = bus.read_stamped
            hear = bus.write
            self.told: list[object] = []
            self.obeys = False

            def answer(unit: int, address: int, *rest: int, **how: Any) -> tuple[list[int], float, float]:
                words, *times = read(unit, address, *rest, **how)
                if address == self.STATUS:
                    words[0] |= self.RUNS_ON & 0x0038
                return words, times[0], times[1]

            def take(unit: int, address: int, value: int, **how: Any) -> None:
                self.told.append(value)
                if self.obeys:
                    hear(unit, address, value, **how)

            monkeypatch.setattr(bus, "read_stamped", answer)
            monkeypatch.setattr(bus, "write", take)
            yield drive

    @pytest.mark.parametrize(("command", "code"), [("stop", 6), ("coast", 5)])
    def test_it_has_not_stopped(self, drive: Drive, command: str, code: int) -> None:
        with pytest.raises(Unconfirmed, match=rf"{command} was sent.*forward, in fault"):
            getattr(drive, command)()
        assert self.told == [code]

    def test_it_has_once_it_stands(self, drive: Drive) -> None:
        """The fault is still there, and is no reason not to look on."""
        self.obeys = True
        drive.stop()
        assert drive.status().state is State.FAULT

    def test_the_fault_is_told_beside_it(self, drive: Drive) -> None:
        status = drive.status()
        assert (status.state, status.fields["fault"]) == (State.FORWARD, "fault")
        assert status.fields["fault_reaction"] == "keep running"

    def test_it_is_not_started_again(self, drive: Drive) -> None:
        with pytest.raises(drivebus.NotAllowed, match="is in fault"):
            drive.run(10.0)
        assert self.told == []

    def test_a_reset_that_changes_nothing_is_not_confirmed(self, drive: Drive) -> None:
        with pytest.raises(Unconfirmed, match=r"fault reset was sent.*forward, in fault"):
            drive.reset_fault()
        assert self.told == [8]
