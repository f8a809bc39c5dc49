"""A Huanyang HY from a program: every byte on the line, typed by hand.

LinuxCNC, src/hal/user_comps/huanyang-vfd/hy_vfd.c and hy_comm.c (functions, statuses and their scales); FluidNC,
Spindles/VFD/HuanyangProtocol.cpp (frames of start, stop and 25 Hz); Dema D5M manual, pp. 68 to 72 (bits of the control,
a status read with one byte); a HY01D523B's own frames (unininu.tistory.com).
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

import drivebus
from drivebus import Bus, Drive, NotAllowed, Profile, Simulator, State, aio
from drivebus.rtu import framed

from .on_the_wire import asked
from .postgres_server import until

FORWARD, REVERSE, STOP = "03 01 01", "03 01 11", "03 01 08"


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "huanyang-hy"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator) as bus:
        yield bus


@pytest.fixture
def drive(bus: Bus) -> Drive:
    drive = bus.drive(1, "huanyang-hy", unverified=True)
    drive.prepare_control(setpoint="frequency", store=True)
    return drive


def written(simulator: Simulator) -> list[str]:
    """What may have changed something."""
    return [pdu for pdu in asked(simulator) if pdu[:2] in ("02", "03", "05")]


def test_a_whole_job(simulator: Simulator, drive: Drive) -> None:
    machine = simulator.drive(1)
    assert written(simulator) == ["02 03 01 00 02", "02 03 02 00 02"], "PD001 and PD002 are 2"
    drive.run(hz=25.0)
    # 25 Hz is 09C4H, as FluidNC has it.
    assert written(simulator)[2:] == ["05 02 09 C4", FORWARD]
    drive.wait_for_speed(timeout=20.0)
    assert (machine.state, round(machine.frequency, 2)) == ("forward", 25.0)
    drive.setpoint = 40.0
    drive.run(reverse=True)
    drive.wait_for_speed(timeout=40.0)
    status = drive.status()
    assert (status.state, float(status.frequency or 0), status.state.running) == (State.RUNNING, 40.0, True)
    drive.bus.sleep(60.0)
    assert (machine.state, round(machine.frequency, 2)) == ("reverse", -40.0)
    drive.stop()
    drive.wait_until_stopped(timeout=40.0)
    # 0FA0H is 40 Hz. Each is sent once.
    assert written(simulator)[4:] == ["05 02 0F A0", REVERSE, STOP]
    assert (machine.state, drive.state()) == ("stopped", State.STOPPED)


def test_the_frames_are_those_that_others_send(simulator: Simulator, drive: Drive) -> None:
    """FluidNC: start, stop, 25 Hz; HY01D523B: PD001 and PD002 of unit 4, here of unit 1; D5M manual: status 0."""
    drive.run(hz=25.0)
    drive.stop()
    drive.read("PD001", "PD002", "set_frequency_actual")
    sent = [frame.hex(" ") for _, side, frame in simulator.line.trace() if side == "master"]
    for frame in ("01 03 01 01 31 88", "01 03 01 08 f1 8e", "01 05 02 09 c4 bf 0f", "01 04 01 00 41 89"):
        assert frame in sent
    for pdu in ("01 03 01 00 00", "01 03 02 00 00"):
        assert framed(bytes.fromhex(f"01 {pdu}")).hex(" ") in sent


def test_what_it_measures(simulator: Simulator, drive: Drive) -> None:
    drive.run(hz=30.0)
    drive.wait_for_speed(timeout=20.0)
    values = drive.monitor()
    assert (float(values["running_frequency"]), float(values["set_frequency_actual"])) == (30.0, 30.0)
    assert float(values["output_current"]) > 0
    assert {pdu[:5] for pdu in asked(simulator)} >= {"04 01"}


def test_every_row_is_answered_or_refused_as_it_says(bus: Bus, drive: Drive) -> None:
    profile = Profile.builtin("huanyang-hy")
    for name in profile.names():
        row = profile.describe(name)
        assert row.address is not None
        if row.access != "wo":
            assert len(drive.read_words(row.address)) == 1, name
        if row.access == "ro":
            with pytest.raises(NotAllowed):
                bus.write(1, row.address, 1)


@pytest.mark.parametrize("hertz", [0.0, 0.01, 49.99, 50.0])
def test_the_setpoint_ends_at_pd005(simulator: Simulator, drive: Drive, hertz: float) -> None:
    drive.setpoint = hertz
    assert written(simulator)[-1] == "05 02 " + round(hertz * 100).to_bytes(2, "big").hex(" ").upper()
    before = written(simulator)
    for beyond in (50.01, -0.01, 0.005):
        with pytest.raises(NotAllowed):
            drive.setpoint = beyond
    assert written(simulator) == before


@pytest.mark.parametrize(
    ("name", "value", "pdu"),
    [("PD014", 5.0, "02 03 0E 00 32"), ("PD005", 400.0, "02 03 05 9C 40"), ("PD143", 2, "02 03 8F 00 02")],
)
def test_a_parameter_is_written_and_read_by_its_number(
    simulator: Simulator, drive: Drive, name: str, value: float, pdu: str
) -> None:
    """FluidNC: PD014 in tenths. LinuxCNC: PD005 in hundredths. 143 is 8FH, whose value is answered by one byte."""
    before = simulator.drive(1).eeprom_writes
    drive.write(name, value, store=True)
    assert (written(simulator)[-1], float(drive.read(name))) == (pdu, value)
    assert simulator.drive(1).eeprom_writes == before + 1
    with pytest.raises(NotAllowed, match="store=True"):
        drive.write(name, value)


def test_it_knows_no_coast_no_jog_and_no_reset(simulator: Simulator, drive: Drive) -> None:
    assert set(Profile.builtin("huanyang-hy").commands()) == {"run_forward", "run_reverse", "stop"}
    before = written(simulator)
    for refused in (drive.coast, drive.jog):
        with pytest.raises(NotAllowed, match="of Huanyang HY is known"):
            refused()
    with pytest.raises(NotAllowed, match="of Huanyang HY is known"):
        drive.reset_fault()
    assert written(simulator) == before


def test_nothing_moves_unasked(bus: Bus, simulator: Simulator) -> None:
    with pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "huanyang-hy").run(hz=10.0)
    with pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "huanyang-hy").stop()
    assert written(simulator) == []


def test_no_word_that_may_start_it_is_sent_raw(bus: Bus, simulator: Simulator) -> None:
    drive = bus.drive(1, "huanyang-hy", unverified=True)
    with pytest.raises(NotAllowed, match="can move the motor"):
        drive.write("control", 0x11)
    with pytest.raises(NotAllowed, match="0300H"):
        bus.write(1, 0x0300, 0x41)
    assert written(simulator) == []


@pytest.mark.usefixtures("drive")
def test_nothing_of_modbus_is_sent_to_it(bus: Bus, simulator: Simulator) -> None:
    before = asked(simulator)
    for refused in (
        lambda: bus.read(1, 0x2103),
        lambda: bus.read(1, 0x0400, 2),
        lambda: bus.read(1, 0x0001, table="input"),
        lambda: bus.write(1, 0x0500, [1, 2]),
        lambda: bus.echo(1),
        lambda: bus.identify(1),
    ):
        with pytest.raises(NotAllowed, match="speaks Huanyang's own protocol"):
            refused()
    assert asked(simulator) == before


@pytest.mark.parametrize("family", ["gd350", "vfd500", "h100", "wj200", "atv312"])
def test_a_drive_of_modbus_that_is_named_so_is_not_moved(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, "huanyang-hy", unverified=True)
        for told in (drive.status, drive.stop, lambda: drive.run(hz=10.0)):
            with pytest.raises(drivebus.DrivebusError):
                told()
        machine = line.drive(1)
        assert (machine.state, machine.take_writes(), machine.eeprom_writes) == ("stopped", [], 0)


def test_one_that_is_named_otherwise_is_not_moved() -> None:
    for family in ("gd350", "vfd500", "eds300", "h100", "md500"):
        with Simulator({1: "huanyang-hy"}, transport="process", clock="virtual") as line, Bus(line) as bus:
            with pytest.raises(drivebus.DrivebusError):
                bus.drive(1, family, unverified=True).stop(within=0.5)
            assert (line.drive(1).state, line.drive(1).take_writes()) == ("stopped", [])


def test_an_event_loop_drives_it(simulator: Simulator) -> None:
    async def drives() -> str:
        async with aio.Bus(simulator) as bus:
            drive = await bus.drive(1, "huanyang-hy", unverified=True)
            await drive.prepare_control(setpoint="frequency", store=True)
            await drive.run(hz=20.0)
            await drive.wait_for_speed(timeout=20.0)
            state = simulator.drive(1).state
            await drive.stop()
            return state

    assert asyncio.run(drives()) == "forward"
    assert written(simulator)[-3:] == ["05 02 07 D0", FORWARD, STOP]


PROGRAM = """
import sys, time
import drivebus
bus = drivebus.Bus(sys.argv[1], parity="N")
drive = bus.drive(1, "huanyang-hy", unverified=True)
drive.prepare_control(setpoint="frequency", store=True)
with drive.running(20.0):
    print("running", flush=True)
    time.sleep(1000)
"""


@pytest.mark.usefixtures("folder")
@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_a_program_that_runs_it_is_killed_and_it_is_stopped() -> None:
    """By another program, through which the first one used the port, and which names it in no way."""
    with (
        Simulator({1: "huanyang-hy"}, parity="N") as simulator,
        Bus(simulator.port, parity="N"),
        subprocess.Popen([sys.executable, "-c", PROGRAM, simulator.port], stdout=subprocess.PIPE, text=True) as child,
    ):
        try:
            assert child.stdout is not None
            assert child.stdout.readline() == "running\n"
            assert simulator.drive(1).state == "forward"
        finally:
            child.kill()
        until(lambda: simulator.drive(1).state == "stopped")
        assert written(simulator)[-1] == STOP
        assert {pdu[:2] for pdu in asked(simulator)} <= {"01", "02", "03", "04", "05"}


@pytest.mark.parametrize("name", ["Huanyang HY", "HY02D223B", "Dema D5M"])
def test_it_goes_by_what_stands_on_it(name: str) -> None:
    assert Profile.find(name) is Profile.builtin("huanyang-hy")
