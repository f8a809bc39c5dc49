"""Teco E510: the frames of its maker's pages, and what is told from it before a write.

E510 communication addendum (Teco-Westinghouse), pp. 1-4 to 1-14; F510 manual (easymanua.ls teco f510-series), p. 455;
VDI100 manual (manualslib 1598439), p. 300.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import pytest
from click.testing import CliRunner

import drivebus
from drivebus import Bus, Drive, NotAllowed, Simulator, State, Unverified
from drivebus.cli import cli

COMMAND, SETPOINT, COMMAND_SOURCE, FREQUENCY_SOURCE = 0x2501, 0x2502, 0x0002, 0x0005


@pytest.fixture
def line() -> Iterator[Simulator]:
    """One whose 00-02 and 00-05 somebody has set."""
    with Simulator({1: "e510"}, transport="process", clock="virtual") as simulator:
        with Bus(simulator) as bus:
            bus.write(1, COMMAND_SOURCE, 2)
            bus.write(1, FREQUENCY_SOURCE, 5)
        simulator.drive(1).take_writes()
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "e510", unverified=True)


def sent(line: Simulator) -> list[str]:
    frames = [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] in (0x06, 0x10)]
    return frames[2:]


def test_its_commands_are_the_frames_of_its_makers_manual(line: Simulator, drive: Drive) -> None:
    """01 06 25 01 00 01 12 C6 is forward, 00 03 93 07 reverse, 00 00 D3 06 stops it (F510, p. 455)."""
    drive.run()
    drive.stop()
    drive.run(reverse=True)
    assert drive.state() is State.REVERSE
    drive.stop()
    assert sent(line) == [
        "01 06 25 01 00 01 12 c6",
        "01 06 25 01 00 00 d3 06",
        "01 06 25 01 00 03 93 07",
        "01 06 25 01 00 00 d3 06",
    ]


def test_a_setpoint_is_the_frame_of_its_makers_manual(line: Simulator, drive: Drive) -> None:
    """01 06 25 02 17 70 2D 12 is 60.00 Hz (VDI100, p. 300)."""
    drive.setpoint = 60.0
    assert sent(line) == ["01 06 25 02 17 70 2d 12"]


def test_it_runs_at_its_setpoint(line: Simulator, drive: Drive) -> None:
    with Bus(line) as bus, pytest.raises(Unverified, match="scale"):
        bus.drive(1, "e510").run(20.0)
    drive.run(20.0)
    drive.wait_for_speed(20.0, timeout=60.0)
    assert line.drive(1).frequency == 20.0
    drive.stop()
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)
    assert line.drive(1).eeprom_writes == 2, "00-02 and 00-05 alone"


def test_who_gives_the_commands_is_not_set_by_what_is_printed_alone() -> None:
    with Simulator({1: "e510"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        with pytest.raises(Unverified, match="00-02"):
            bus.drive(1, "e510").prepare_control(store=True)
        assert line.drive(1).writes() == []
        bus.drive(1, "e510", unverified=True).prepare_control(store=True)
        assert [(place, word) for _, place, word in line.drive(1).writes()] == [(0x0002, 2), (0x0005, 5)]


def test_a_stop_waits_until_the_motor_stands(line: Simulator, drive: Drive) -> None:
    """Whether bit 0 goes off before, no page says: the output frequency is looked at, too."""
    drive.run(40.0)
    line.advance(30.0)
    drive.stop()
    assert line.drive(1).frequency == 0.0
    asked = [data[2:4].hex() for _, who, data in line.line.trace() if who == "master" and data[1] == 0x03]
    assert asked[-1] == "2524" or "2524" in asked[-4:]


def test_a_fault_has_the_name_of_the_addendum(line: Simulator, drive: Drive) -> None:
    line.drive(1).trip(19)
    fault = drive.fault()
    assert fault is not None
    assert (fault.code, fault.mnemonic) == (19, "OC-A")
    with pytest.raises(NotAllowed, match="is in fault"):
        drive.run(10.0)
    drive.reset_fault()
    assert drive.fault() is None


@pytest.mark.parametrize(
    ("request_", "exception"),
    [
        ("04 25 20 00 01", 0x01),
        ("03 20 00 00 01", 0x02),
        ("03 25 20 00 11", 0x03),
        ("06 25 02 fd e9", 0x04),
        ("06 25 20 00 00", 0x05),
    ],
)
def test_it_refuses_by_the_table_of_the_addendum(line: Simulator, request_: str, exception: int) -> None:
    with Bus(line) as bus, pytest.raises(drivebus.Refused) as refused:
        bus.transact(1, bytes.fromhex(request_))
    assert refused.value.code == exception


def test_what_its_examples_command_are_parameters(line: Simulator) -> None:
    """01 06 01 02 17 70 27 E2 is printed for 60.00 Hz (p. 1-10), and 0102H is 01-02 by the table (p. 1-13)."""
    port = ["--port", "sim://e510?clock=virtual", "--profile", "e510"]
    told = CliRunner().invoke(cli, [*port, "raw", "01 06 01 02 17 70"])
    assert told.exit_code != 0
    with Bus(line) as bus:
        bus.write(1, 0x0102, 0x1770)
        bus.write(1, 0x0101, 1)
    assert line.drive(1).state == "stopped"


OTHERS = [
    "a1000",
    "j1000",
    "acs355",
    "acs580",
    "fr-d700",
    "v20",
    "h100",
    "gd350",
    "ms300",
    "md500",
    "chf100a",
    "vfd500",
]
"""Those that are commanded where it has parameters, and some of those that are not."""


@pytest.mark.parametrize("named", OTHERS)
def test_a_stop_by_another_name_stops_it(line: Simulator, drive: Drive, named: str) -> None:
    drive.run(20.0)
    line.advance(20.0)
    with Bus(line) as bus, suppress(NotAllowed):
        bus.drive(1, named, unverified=True).stop()
    line.advance(20.0)
    assert (line.drive(1).state, line.drive(1).frequency) == ("stopped", 0.0)


def test_it_is_known_by_its_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == ("e510", "by answers")
