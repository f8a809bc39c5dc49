"""What a drive does when it is told to, on every kind of line: in process, pseudo-terminal, TCP.

What the machine's side saw is asked of the simulator, not of the code under test. Register addresses and command codes
are those of the GD350 manual, chapter 9.4.
"""

from __future__ import annotations

import threading

import pytest

import drivebus
from drivebus import Bus, Choice, ControlSource, Drive, NoAnswer, Simulator, State

CONTROL, SETPOINT, ACCELERATION = 0x2000, 0x2001, 0x000B
RAM = 0x8000
FORWARD, REVERSE, JOG, STOP, COAST, RESET, JOG_STOP = 1, 2, 3, 5, 6, 7, 8
OL1, EF = 11, 17


def commands(simulator: Simulator, unit: int = 1) -> list[int]:
    """The command words that the drive took."""
    return [value for _, address, value in simulator.drive(unit).writes() if address == CONTROL]


def requests(simulator: Simulator) -> list[bytes]:
    """What the master sent, as it was on the wire."""
    return [data for _, who, data in simulator.line.trace() if who == "master"]


class TestWhoIsThere:
    def test_a_drive_is_identified(self, bus: Bus) -> None:
        drive = bus.drive(1)
        assert drive.profile.name == "gd350"
        assert drive.read("identification_code") == 0x01A0

    def test_a_scan_finds_those_that_answer(self, bus: Bus, timeout: float) -> None:
        found = list(bus.scan(range(1, 5), timeout=timeout))
        assert [(each.unit, each.profile, each.identification) for each in found] == [
            (1, "gd350", 0x01A0),
            (2, "gd350", 0x01A0),
        ]
        assert all(0 < each.round_trip < timeout for each in found)

    def test_an_echo_comes_back(self, bus: Bus) -> None:
        assert bus.echo(1, 0x12AB) > 0
        assert bus.echo(2) > 0

    def test_any_pdu_travels(self, bus: Bus) -> None:
        assert bus.transact(1, bytes.fromhex("03 21 03 00 01")) == bytes.fromhex("03 02 01 A0")


class TestWords:
    def test_reads_and_writes(self, bus: Bus) -> None:
        assert bus.read(1, 0x2100, 3) == [3, bus.read(1, 0x2101)[0], 0]
        bus.write(1, RAM | ACCELERATION, 123)
        assert bus.read(1, ACCELERATION) == [123]
        bus.write(1, RAM | ACCELERATION, [50, 60])
        assert bus.read(1, ACCELERATION, 2) == [50, 60]

    def test_a_broadcast_reaches_all(self, bus: Bus) -> None:
        bus.broadcast(RAM | ACCELERATION, 77)
        assert [bus.read(unit, ACCELERATION) for unit in (1, 2)] == [[77], [77]]

    @pytest.mark.parametrize(
        ("address", "count", "code"),
        [
            pytest.param(0x6300, 1, 2, id="P99 is closed"),
            pytest.param(RAM | ACCELERATION, 1, 2, id="RAM addresses cannot be read"),
            pytest.param(0x3000, 17, 3, id="17 words are too many"),
        ],
    )
    def test_a_refusal_says_why(self, bus: Bus, address: int, count: int, code: int) -> None:
        with pytest.raises(drivebus.Refused) as refused:
            bus.read(1, address, count)
        error = refused.value
        assert (error.code, error.unit, error.raw[1]) == (code, 1, 0x83)
        assert error.name
        assert error.started is not None
        assert error.ended is not None
        assert error.started <= error.ended
        assert bus.read(1, 0x2103) == [0x01A0]

    def test_a_drive_knows_what_its_refusals_mean(self, simulator: Simulator, drive: Drive) -> None:
        simulator.drive(drive.unit).refuse(0x09)
        with pytest.raises(drivebus.Refused, match="locked") as refused:
            drive.read("P00.11")
        assert (refused.value.code, refused.value.name) == (9, "password_protected")
        assert "user password" in refused.value.meaning

    def test_silence_is_no_answer(self, bus: Bus) -> None:
        with pytest.raises(drivebus.NoAnswer) as silent:
            bus.read(9, 0x2100)
        assert silent.value.unit == 9
        assert silent.value.request[:2] == bytes([9, 3])
        assert bus.read(1, 0x2103) == [0x01A0]

    def test_threads_share_a_bus(self, bus: Bus) -> None:
        wrong: list[object] = []

        def work(unit: int, value: int) -> None:
            for turn in range(10):
                bus.write(unit, RAM | ACCELERATION, value + turn)
                if bus.read(unit, ACCELERATION) != [value + turn]:
                    wrong.append((unit, turn))

        threads = [threading.Thread(target=work, args=(unit, unit * 100)) for unit in (1, 2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert wrong == []

    def test_a_read_only_bus_sends_no_write(self, simulator: Simulator) -> None:
        with Bus(simulator, read_only=True) as bus:
            drive = bus.drive(1)
            before = simulator.line.requests
            for attempt in (
                lambda: bus.write(1, CONTROL, FORWARD),
                lambda: bus.broadcast(CONTROL, FORWARD),
                lambda: bus.transact(1, bytes([6, 0x20, 0x00, 0x00, 0x01])),
                drive.stop,
                lambda: drive.write("P00.11", 5.0),
            ):
                with pytest.raises(drivebus.NotAllowed):
                    attempt()
            assert simulator.line.requests == before


class TestControl:
    def test_a_new_drive_does_not_obey_the_bus(self, simulator: Simulator, drive: Drive) -> None:
        assert not drive.check_control()
        assert drive.status().source is not ControlSource.COMMUNICATION
        with pytest.raises(drivebus.NotAllowed, match=r"prepare_control\(\)"):
            drive.run(10.0)
        with pytest.raises(drivebus.NotAllowed, match=r"prepare_control\(\)"):
            drive.jog()
        assert simulator.drive(1).writes() == []

    def test_prepare_control_writes_only_what_differs(self, simulator: Simulator, drive: Drive) -> None:
        control = drive.prepare_control()
        assert control
        assert [(item.code, item.actual) for item in control] == [("P00.01", 2), ("P00.02", 0), ("P00.06", 8)]
        assert drive.status().source is ControlSource.COMMUNICATION
        written = len(simulator.drive(1).writes())
        drive.prepare_control()
        assert len(simulator.drive(1).writes()) == written
        assert simulator.drive(1).eeprom_writes == 0


class TestRunning:
    def test_command_and_setpoint_travel_in_one_frame(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.run(hz=10.0)
        # GD300 manual, p. 231: 01 10 20 00 00 02 04 00 01 03 E8 3B 10 is forward run at 10.00 Hz.
        frame = bytes.fromhex("01 10 20 00 00 02 04 00 01 03 E8 3B 10")
        assert requests(simulator).count(frame) == 1
        assert commands(simulator) == [FORWARD]
        status = obedient.wait_for_speed(timeout=10)
        assert (status.state, status.setpoint) == (State.FORWARD, 10.0)
        assert simulator.drive(1).frequency == pytest.approx(10.0, abs=0.1)
        obedient.stop()
        status = obedient.wait_until_stopped(timeout=10)
        assert (status.state, status.frequency) == (State.STOPPED, 0.0)
        assert commands(simulator) == [FORWARD, STOP]
        assert simulator.drive(1).frequency == 0.0

    def test_reverse(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.run(hz=5.0, reverse=True)
        assert obedient.wait_for_speed(timeout=10).state is State.REVERSE
        assert simulator.drive(1).frequency == pytest.approx(-5.0, abs=0.1)
        assert simulator.drive(1).speed < 0
        obedient.coast()
        assert commands(simulator) == [REVERSE, COAST]

    def test_the_setpoint_changes_while_it_runs(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.run(hz=5.0)
        obedient.setpoint = 8.0
        assert obedient.setpoint == 8.0
        obedient.wait_for_speed(8.0, timeout=10)
        assert commands(simulator) == [FORWARD]

    def test_a_run_in_the_other_direction_is_confirmed(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.run(hz=5.0)
        obedient.wait_for_speed(timeout=10)
        obedient.run(hz=5.0, reverse=True)
        assert commands(simulator) == [FORWARD, REVERSE]

    def test_coasting_takes_the_voltage_off(self, simulator: Simulator, obedient: Drive) -> None:
        simulator.drive(1).load = 0.0
        obedient.run(hz=10.0)
        obedient.wait_for_speed(timeout=10)
        obedient.coast()
        assert simulator.drive(1).frequency == 0.0
        assert simulator.drive(1).speed > 0
        assert commands(simulator) == [FORWARD, COAST]

    def test_jogging(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.jog()
        assert obedient.status().state is State.FORWARD
        obedient.jog_stop()
        obedient.wait_until_stopped(timeout=20)
        assert commands(simulator) == [JOG, JOG_STOP]

    def test_a_setpoint_above_the_drives_own_maximum_is_not_sent(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.write({"P00.04": 40.0, "P00.03": 40.0}, unverified=True)
        before = len(simulator.drive(1).writes())
        with pytest.raises(drivebus.NotAllowed, match=r"45 Hz .*P00\.03 = 40 Hz"):
            obedient.run(hz=45.0)
        with pytest.raises(drivebus.NotAllowed, match=r"P00\.03 = 40 Hz"):
            obedient.setpoint = 45.0
        assert len(simulator.drive(1).writes()) == before

    def test_a_block_that_ends_well_stops_the_motor(self, simulator: Simulator, obedient: Drive) -> None:
        with obedient.running(hz=5.0) as same:
            assert same is obedient
            assert obedient.status().state is State.FORWARD
        assert commands(simulator) == [FORWARD, STOP]

    @pytest.mark.parametrize("reason", [KeyboardInterrupt, RuntimeError, drivebus.NoAnswer])
    def test_a_block_that_fails_stops_the_motor(
        self, simulator: Simulator, obedient: Drive, reason: type[BaseException]
    ) -> None:
        with pytest.raises(reason, match="inside"), obedient.running(hz=5.0):
            raise reason("inside")
        start, *stops = commands(simulator)
        # One that is not proved in time, on a machine that has no time for the drive, goes out again.
        assert (start, set(stops)) == (FORWARD, {STOP})
        assert obedient.wait_until_stopped(timeout=10).state is State.STOPPED

    def test_a_block_whose_start_is_refused_sends_nothing(self, simulator: Simulator, drive: Drive) -> None:
        with pytest.raises(drivebus.NotAllowed), drive.running(hz=5.0):
            pytest.fail("the block must not be entered")
        assert commands(simulator) == []


class TestFaults:
    def test_a_fault_is_explained_reset_and_remembered(self, simulator: Simulator, obedient: Drive) -> None:
        assert obedient.fault() is None
        simulator.drive(1).trip("OL1")
        fault = obedient.fault()
        assert fault is not None
        assert (fault.code, fault.mnemonic) == (OL1, "OL1")
        assert "overload" in fault.label.lower()
        assert obedient.status().state is State.FAULT
        with pytest.raises(drivebus.NotAllowed, match="OL1"):
            obedient.run(10.0)
        obedient.reset_fault()
        assert obedient.fault() is None
        assert obedient.fault_history()[0].code == OL1
        assert commands(simulator) == [RESET]

    def test_a_reset_without_a_fault_sends_nothing(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.reset_fault()
        assert commands(simulator) == []

    def test_a_trip_ends_the_waiting(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.run(10.0)
        simulator.drive(1).trip(EF)
        for wait in (obedient.wait_for_speed, obedient.wait_until_stopped):
            with pytest.raises(drivebus.Unconfirmed, match="EF"):
                wait(timeout=5)


class TestParameters:
    def test_values_have_the_type_of_what_they_are(self, drive: Drive) -> None:
        drive.prepare_control()
        values = drive.read("bus_voltage", "external_count", "P00.01", "P00.03")
        assert list(values) == ["bus_voltage", "external_count", "P00.01", "P00.03"]
        assert type(values["bus_voltage"]) is float
        assert type(values["external_count"]) is int
        assert type(values["P00.01"]) is Choice
        assert str(values["P00.01"]) == "communication"
        assert values["P00.03"] == 50.0

    def test_a_monitor_snapshot(self, drive: Drive) -> None:
        snapshot = drive.monitor()
        assert len(snapshot) == 23  # 3000H..3016H
        assert snapshot.units["output_current"] == "A"
        assert snapshot.bus_voltage == snapshot["bus_voltage"]
        assert 200 < snapshot.bus_voltage < 800
        assert snapshot.duration > 0
        assert list(drive.monitor("output_current", "running_frequency")) == ["output_current", "running_frequency"]

    def test_ram_is_lost_and_eeprom_stays(self, simulator: Simulator, drive: Drive) -> None:
        drive.write("P00.11", 3.0)
        assert simulator.drive(1).writes()[-1][1:] == (RAM | ACCELERATION, 30)
        drive.write({"P00.12": 4.0}, store=True)
        assert simulator.drive(1).writes()[-1][1:] == (ACCELERATION + 1, 40)
        assert drive.read("P00.11", "P00.12") == {"P00.11": 3.0, "P00.12": 4.0}
        assert simulator.drive(1).eeprom_writes == 1
        simulator.drive(1).power_cycle()
        values = drive.read("P00.11", "P00.12")
        assert values["P00.11"] != 3.0
        assert values["P00.12"] == 4.0

    def test_eeprom_is_not_written_with_what_it_holds(self, simulator: Simulator, drive: Drive) -> None:
        for _ in range(3):
            drive.write("P00.11", 3.0, store=True)
        assert simulator.drive(1).eeprom_writes == 1

    def test_what_was_written_to_ram_is_stored_all_the_same(self, simulator: Simulator, drive: Drive) -> None:
        drive.write("P00.11", 3.0)
        drive.write("P00.11", 3.0, store=True)
        simulator.drive(1).power_cycle()
        assert drive.read("P00.11") == 3.0

    def test_what_ram_may_have_taken_is_stored_all_the_same(self, simulator: Simulator, drive: Drive) -> None:
        simulator.line.drop_answers(1000)
        with pytest.raises(NoAnswer):
            drive.write("P00.11", 3.0)
        simulator.line.clear()
        drive.write("P00.11", 3.0, store=True)
        simulator.drive(1).power_cycle()
        assert drive.read("P00.11") == 3.0

    def test_control_that_was_set_in_ram_can_be_stored(self, simulator: Simulator, drive: Drive) -> None:
        drive.prepare_control()
        assert simulator.drive(1).eeprom_writes == 0
        drive.prepare_control(store=True)
        simulator.drive(1).power_cycle()
        assert drive.check_control()
        writes = simulator.drive(1).eeprom_writes
        drive.prepare_control(store=True)
        assert simulator.drive(1).eeprom_writes == writes == 2  # P00.02 was right from the start

    def test_storing_in_a_loop_is_warned_about(self, drive: Drive) -> None:
        for seconds in (1.0, 2.0, 3.0, 4.0):
            drive.write("P00.11", seconds, store=True)
        with pytest.warns(drivebus.StoreWarning, match=r"P00\.11"):
            drive.write("P00.11", 5.0, store=True)

    def test_one_bad_value_and_none_is_written(self, simulator: Simulator, drive: Drive) -> None:
        with pytest.raises(drivebus.NotAllowed, match=r"P00\.12"):
            drive.write({"P00.11": 3.0, "P00.12": 4000.0})
        assert simulator.drive(1).writes() == []

    def test_what_is_locked_while_running_is_not_sent(self, simulator: Simulator, obedient: Drive) -> None:
        obedient.run(5.0)
        before = len(simulator.drive(1).writes())
        with pytest.raises(drivebus.NotAllowed, match="stopped"):
            obedient.write({"P00.11": 3.0, "P00.03": 40.0})
        assert len(simulator.drive(1).writes()) == before


def test_the_silence_between_frames_is_kept() -> None:
    """In virtual time: on the other lines a busy machine decides when a byte of one is seen by the other."""
    with drivebus.Simulator({1: "gd350"}, transport="process") as simulator, drivebus.Bus(simulator) as bus:
        drive = bus.drive(1, "gd350")
        for _ in range(5):
            drive.monitor()
            drive.status()
        assert simulator.line.silence_violations == 0
