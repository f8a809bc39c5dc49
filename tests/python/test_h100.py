"""An H100 from a program: every byte on the line, typed by hand.

Coils and setpoint: FluidNC, H100Spindle.md, which has them as tested. 0210H: measured at a Vevor D100 (git.bartool.ovh
bartool/linuxcnc-modbus, modbus.md). Faults: JustKitting/linuxcnc_dmc2, h100_protocol.py, of p. 84 of the manual V1.8.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import drivebus
from drivebus import Bus, Drive, NotAllowed, Profile, Simulator, State
from drivebus.rtu import framed

from .on_the_wire import written

FORWARD, REVERSE, STOP = "05 00 49 FF 00", "05 00 4A FF 00", "05 00 4B FF 00"


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "h100"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator) as bus:
        yield bus


@pytest.fixture
def drive(bus: Bus) -> Drive:
    drive = bus.drive(1, "h100", unverified=True)
    drive.prepare_control(store=True)
    return drive


def test_a_whole_job(simulator: Simulator, drive: Drive) -> None:
    machine = simulator.drive(1)
    assert written(simulator) == ["06 00 01 00 02", "06 00 02 00 02"], "F001 and F002 are 2"
    drive.run(hz=200.0)
    # The first frame is one of H100Spindle.md.
    assert written(simulator)[2:] == ["06 02 01 07 D0", FORWARD]
    drive.wait_for_speed(timeout=20.0)
    assert (machine.state, round(machine.frequency, 1)) == ("forward", 200.0)
    drive.setpoint = 120.5
    drive.run(reverse=True)
    drive.wait_for_speed(timeout=40.0)
    assert (machine.state, round(machine.frequency, 1)) == ("reverse", -120.5)
    status = drive.status()
    assert (status.state, float(status.frequency or 0)) == (State.REVERSE, 120.5)
    drive.stop()
    drive.wait_until_stopped(timeout=40.0)
    # 04B5H is 120.5 Hz. The trace does not reach back to the start.
    assert written(simulator)[-3:] == ["06 02 01 04 B5", REVERSE, STOP]


def test_the_frames_are_those_that_others_send(simulator: Simulator, drive: Drive) -> None:
    """H100Spindle.md: 05 0049, 05 004B, 06 0201 07D0. The CRC that it has for a coil, 0C 2C, is a wrong one."""
    drive.run(hz=200.0)
    drive.stop()
    sent = [frame.hex(" ") for _, side, frame in simulator.line.trace() if side == "master"]
    for wanted in ("01 06 02 01 07 d0", "01 05 00 49 ff 00", "01 05 00 4b ff 00"):
        assert framed(bytes.fromhex(wanted)).hex(" ") in sent


def test_f169_says_what_the_setpoint_counts(simulator: Simulator, drive: Drive) -> None:
    """Section 6.10 of the D100's manual: with 1, 0201H has two decimals."""
    drive.write("F169", 1, store=True)
    drive.run(hz=200.0)
    drive.wait_for_speed(timeout=20.0)
    assert round(simulator.drive(1).frequency, 1) == 200.0
    assert "06 02 01 4E 20" in written(simulator)


def test_a_stop_coasts_if_f026_says_so(simulator: Simulator, drive: Drive) -> None:
    drive.write("F026", 1, store=True)
    drive.run(hz=200.0)
    drive.wait_for_speed(timeout=20.0)
    drive.stop()
    drive.wait_until_stopped(timeout=120.0)
    assert written(simulator)[-1] == STOP


def test_it_knows_no_coast_no_jog_and_no_reset(simulator: Simulator, drive: Drive) -> None:
    assert set(Profile.builtin("h100").commands()) == {"run_forward", "run_reverse", "stop"}
    before = written(simulator)
    for refused in (drive.coast, drive.jog):
        with pytest.raises(NotAllowed, match="of H100 is known"):
            refused()
    simulator.drive(1).trip(67)
    with pytest.raises(NotAllowed, match="of H100 is known"):
        drive.reset_fault()
    assert written(simulator) == before


@pytest.mark.parametrize(
    ("number", "mnemonic"), [(64, "E.OC.S"), (67, "E.OC.n"), (81, "E.oU.A"), (94, "E.oH.d"), (107, "E.oT.n")]
)
def test_a_trip_has_its_number_and_its_name(simulator: Simulator, drive: Drive, number: int, mnemonic: str) -> None:
    assert drive.fault() is None
    simulator.drive(1).trip(number)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (number, mnemonic)
    with pytest.raises(NotAllowed):
        drive.run(hz=10.0)


@pytest.mark.parametrize(
    ("word", "state"),
    [(0, "stopped"), (9, "forward"), (13, "reverse"), (4, "stopped")],
)
def test_states_are_those_that_were_measured(word: int, state: str) -> None:
    assert Profile.builtin("h100").state(word) == state


def test_what_it_measures_is_read_by_04h(simulator: Simulator, drive: Drive) -> None:
    drive.run(hz=50.0)
    drive.wait_for_speed(timeout=20.0)
    before = len(simulator.line.trace())
    values = drive.read("running_frequency", "set_frequency_actual", "rotation_speed", "fault_code")
    assert (float(values["running_frequency"]), float(values["set_frequency_actual"])) == (50.0, 50.0)
    asked = [frame[1] for _, side, frame in simulator.line.trace()[before:] if side == "master"]
    assert set(asked) == {0x04}
    assert drive.monitor()["running_frequency"] == values["running_frequency"]


def test_nothing_moves_unasked(bus: Bus, simulator: Simulator) -> None:
    with pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "h100").run(hz=10.0)
    with pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "h100").stop()
    assert written(simulator) == []


def test_no_word_that_may_start_it_is_sent_raw(bus: Bus, simulator: Simulator) -> None:
    """Bit 0 of 0200H, and coil 0048H, run it the way it ran last."""
    drive = bus.drive(1, "h100", unverified=True)
    for name in ("control_word", "run_command", "forward_command", "jog_reverse_command"):
        with pytest.raises(NotAllowed, match="can move the motor"):
            drive.write(name, 1)
    with pytest.raises(NotAllowed, match="coil 0049H"):
        bus.write(1, 0x0049, 0, table="coil")
    assert written(simulator) == []


def test_it_is_told_by_its_answers(bus: Bus) -> None:
    found = bus.identify(1)
    assert (found.family, found.certainty) == ("h100", "by answers")


@pytest.mark.parametrize("family", ["a1000", "v20", "acs355", "wj200"])
def test_others_that_have_words_at_its_addresses_are_not_taken_for_it(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        assert bus.identify(1).family == family


@pytest.mark.parametrize("name", ["H100", "StepperOnline V70", "stepperonline-v70", "Vevor D100"])
def test_it_goes_by_what_stands_on_it(name: str) -> None:
    assert Profile.find(name) is Profile.builtin("h100")
    assert "h100" in drivebus.profiles()
