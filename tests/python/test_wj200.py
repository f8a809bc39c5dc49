"""A Hitachi WJ200 from a program: every byte on the line, typed by hand.

Coils: WJ200 manual, p. B-24. The run command is printed, CRC and all, for its successor
(easymanua.ls hitachi wj-c1-series, p. 342). Registers: p. B-26, and Omron MX2 manual, p. 309. Each is one less on the
wire.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from drivebus import Bus, Drive, NoAnswer, NotAllowed, Simulator, State, Unconfirmed

from .on_the_wire import written

RUN = bytes.fromhex("01 05 00 00 FF 00 8C 3A")


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "wj200"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def bus(simulator: Simulator) -> Iterator[Bus]:
    with Bus(simulator) as bus:
        yield bus


@pytest.fixture
def drive(bus: Bus) -> Drive:
    return bus.drive(1, "wj200", unverified=True)


def test_a_whole_job(simulator: Simulator, drive: Drive) -> None:
    machine = simulator.drive(1)
    drive.run(hz=10.0)
    drive.wait_for_speed(timeout=20.0)
    assert (machine.state, round(machine.frequency, 1)) == ("forward", 10.0)
    drive.setpoint = 12.5
    drive.run(reverse=True)
    drive.wait_for_speed(timeout=40.0)
    assert (machine.state, round(machine.frequency, 1)) == ("reverse", -12.5)
    drive.stop()
    drive.wait_until_stopped(timeout=40.0)
    assert written(simulator) == [
        "06 00 01 03 E8",  # 10.00 Hz
        "05 00 01 00 00",  # forward
        "05 00 00 FF 00",  # run
        "06 00 01 04 E2",  # 12.50 Hz
        "05 00 01 FF 00",  # reverse
        "05 00 00 FF 00",  # run
        "05 00 00 00 00",  # stop
    ]
    assert RUN in [frame for _, side, frame in simulator.line.trace() if side == "master"]


def test_each_table_is_read_by_its_own_function(simulator: Simulator, drive: Drive) -> None:
    drive.run(hz=10.0)
    before = len(simulator.line.trace())
    values = drive.read("inverter_ready", "operation_status", "rotation_direction", "inverter_status_a")
    assert values == {
        "inverter_ready": 1,
        "operation_status": 1,
        "rotation_direction": 1,
        "inverter_status_a": 3,
    }
    asked = [frame[1:-2].hex(" ").upper() for _, side, frame in simulator.line.trace()[before:] if side == "master"]
    # Holding registers in address order, then coils 000EH to 0010H in one read.
    assert asked == ["03 00 02 00 01", "03 10 03 00 01", "01 00 0E 00 03"]


def test_a_trip_is_told_by_the_alarm_coil_and_reset_by_another(simulator: Simulator, drive: Drive) -> None:
    simulator.drive(1).trip(1)
    assert drive.status().state is State.STOPPED
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (1, "AL")
    drive.reset_fault()
    assert drive.fault() is None
    assert written(simulator) == ["05 00 03 FF 00"]


def test_what_follows_an_unconfirmed_direction_is_not_sent(
    simulator: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A motor that runs has turned round by the direction alone, so the program is told; the run is not sent."""
    write = Bus.write

    def lost(bus: Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
        write(bus, unit, address, value, **how)
        if how.get("table") == "coil" and address == 1:
            raise NoAnswer("unit 1 is silent", unit=unit, started=1.0)

    monkeypatch.setattr(Bus, "write", lost)
    with pytest.raises(Unconfirmed, match="run reverse was sent"):
        drive.run(reverse=True)
    assert written(simulator) == ["05 00 01 FF 00"]
    assert simulator.drive(1).state == "stopped"


def test_a_stop_between_direction_and_run_is_the_last_word(
    simulator: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = Bus.write

    def stopped(bus: Bus, unit: int, address: int, value: Any, /, **how: Any) -> None:
        write(bus, unit, address, value, **how)
        if how.get("table") == "coil" and address == 1:
            bus.drive(unit, "wj200", unverified=True).stop()

    monkeypatch.setattr(Bus, "write", stopped)
    with pytest.raises(Unconfirmed, match=r"told to stop .* coil 0001H.* the rest of it was not sent"):
        drive.run(reverse=True)
    assert written(simulator) == ["05 00 01 FF 00", "05 00 00 00 00"]
    assert simulator.drive(1).state == "stopped"


def test_nothing_moves_unasked(bus: Bus, simulator: Simulator) -> None:
    with pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "wj200").run(hz=10.0)
    with pytest.raises(NotAllowed, match="unverified=True"):
        bus.drive(1, "wj200").stop()
    assert written(simulator) == []


def test_a_read_of_coils_is_repeated(simulator: Simulator, bus: Bus) -> None:
    assert bus.read(1, 0x000E, 3, table="coil") == [0, 0, 1]
    simulator.line.drop_answers(1)
    assert bus.read(1, 0x000E, 3, table="coil") == [0, 0, 1]


def test_a_write_of_a_coil_is_not(simulator: Simulator, bus: Bus) -> None:
    bus.echo(1)
    simulator.line.drop_answers(1)
    with pytest.raises(NoAnswer):
        bus.write(1, 0, 1, table="coil")
    assert written(simulator) == ["05 00 00 FF 00"]


def test_a_lost_confirmation_of_a_coil_is_looked_up(simulator: Simulator, bus: Bus) -> None:
    bus.echo(1)
    simulator.line.drop_answers(1)
    bus.write(1, 1, 1, table="coil", read_back=1)
    assert written(simulator) == ["05 00 01 FF 00"], "the coil shows it"
    assert bus.read(1, 1, table="coil") == [1]


@pytest.mark.parametrize(
    ("value", "table", "said"),
    [
        (2, "coil", "0 to 1"),
        (0xFF00, "coil", "0 to 1"),
        ([1, 0], "coil", "one coil"),
        (1, "input", "only be read"),
        (1, "discrete", "only be read"),
        (1, "coils", 'did you mean "coil"'),
    ],
)
def test_what_no_coil_takes_is_not_sent(simulator: Simulator, bus: Bus, value: int, table: str, said: str) -> None:
    with pytest.raises(NotAllowed, match=said):
        bus.write(1, 1, value, table=table)
    assert written(simulator) == []


def test_a_table_has_its_own_limit(bus: Bus) -> None:
    with pytest.raises(NotAllowed, match="1 to 125"):
        bus.read(1, 0, 126, table="input")
    with pytest.raises(NotAllowed, match="1 to 2000"):
        bus.read(1, 0, 2001, table="discrete")


def test_a_command_that_no_family_has_is_not_sent_raw(simulator: Simulator, bus: Bus) -> None:
    """0FH writes several coils at once, and 05H one: both may run the motor."""
    bus.drive(1, "wj200")
    with pytest.raises(NotAllowed, match="coil 0003H"):
        bus.write(1, 0x0003, 0, table="coil")
    with pytest.raises(NotAllowed, match="coil 0003H"):
        bus.transact(1, bytes.fromhex("0F 00 00 00 04 01 01"))
    assert written(simulator) == []


def test_a_trace_says_which_coil(simulator: Simulator, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("DEBUG", "drivebus.wire"), Bus(simulator) as bus:
        bus.drive(1, "wj200", unverified=True).run(hz=10.0)
    told = [record.getMessage().split("  ")[-1] for record in caplog.records]
    assert "unit 1: write direction_command = 0" in told
    assert "unit 1: write run_command = 1 (run forward or run reverse)" in told


def test_unknown_units_are_told_by_their_coils(bus: Bus) -> None:
    found = bus.identify(1)
    assert (found.family, found.certainty) == ("wj200", "by answers")
