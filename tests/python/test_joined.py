"""Several parameters in one request: where the family's documents print that, and nowhere else.

The bytes of the first test are the example of the GD350 manual, section 9.4.8: P00.11 = 10 s, P00.12 = 20 s, unit 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, Simulator

BOTH = {"P00.11": 10.0, "P00.12": 20.0}
EXAMPLE = "01 10 00 0b 00 02 04 00 64 00 c8 f2 55"
IN_RAM = "01 10 80 0b 00 02 04 00 64 00 c8 93 93"
ONE_BY_ONE = ["01 06 80 0b 00 64 d0 23", "01 06 80 0c 00 c8 61 9f"]
WRITES = (0x06, 0x10)


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "gd350")


def sent(line: Simulator) -> list[str]:
    """The requests to write, as they were on the wire."""
    return [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] in WRITES]


def test_neighbours_share_a_request(line: Simulator, drive: Drive) -> None:
    drive.write("P00.11", 3.0, store=True)
    drive.write(BOTH, store=True)
    assert sent(line)[1:] == [EXAMPLE]
    line.drive(1).power_cycle()
    assert drive.read(*BOTH) == BOTH


def test_in_ram_as_well(line: Simulator, drive: Drive) -> None:
    drive.write(BOTH)
    assert sent(line) == [IN_RAM]
    assert drive.read(*BOTH) == BOTH
    assert line.drive(1).eeprom_writes == 0
    drive.write(BOTH, store=True)
    assert sent(line)[1:] == [EXAMPLE], "what was in RAM alone is stored"


def test_the_order_is_the_callers(line: Simulator, drive: Drive) -> None:
    drive.write({"P00.12": 20.0, "P00.11": 10.0})
    assert sent(line) == ONE_BY_ONE[::-1]


@pytest.mark.parametrize("family", ["gd300", "gd35", "vfd500"])
def test_a_family_that_does_not_print_it_gets_them_one_by_one(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        profile = drivebus.Profile.builtin(family)
        names = [
            name for name in ("P00.11", "P00.12", "P30.02", "P30.03", "P10.01", "P10.02") if name in profile.names()
        ]
        assert len(names) > 1
        drive = bus.drive(1, family, unverified=True)
        values = drive.read(*names)
        drive.write(values, store=profile.memory() is None)
        assert all(frame[3:5] == "06" for frame in sent(line))
        assert profile.requests()["joined"] is None


def test_what_eeprom_has_is_not_written_again(line: Simulator, drive: Drive) -> None:
    assert drive.read("P00.11") == BOTH["P00.11"]
    drive.write(BOTH, store=True)
    assert sent(line) == ["01 06 00 0c 00 c8 48 5f"]
    assert line.drive(1).eeprom_writes == 1


def test_who_commands_the_drive_is_written_by_itself(line: Simulator, drive: Drive) -> None:
    drive.write({"P00.01": 2, "P00.02": 0}, unverified=True)
    assert [frame[3:5] for frame in sent(line)] == ["06", "06"]


def test_what_narrows_another_is_written_by_itself(line: Simulator, drive: Drive) -> None:
    drive.write({"P00.03": 60.0, "P00.04": 55.0}, unverified=True)
    assert [frame[3:5] for frame in sent(line)] == ["06", "06"]


def test_a_lost_confirmation_is_cleared_up_by_reading(line: Simulator, drive: Drive) -> None:
    drive.read("P00.11")
    line.line.drop_answers(1)
    drive.write(BOTH)
    assert sent(line) == [IN_RAM]
    assert drive.read(*BOTH) == BOTH


def test_a_refusal_says_what_is_in_force(tmp_path: Path) -> None:
    """A drive whose P00.12 ends at 10 s refuses, and nobody knows whether it took the word before: it is asked."""
    (tmp_path / "profile.toml").write_text(
        'name = "short-ramps"\nversion = 1\nsource = "notes"\n[overlay]\nprofile = "gd350"\n', encoding="utf-8"
    )
    (tmp_path / "parameters.csv").write_text(
        "code,name,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n"
        "P00.12,deceleration_time_1,Deceleration time 1,s,10,no,0.0,,10.0,,,run,,yes,,notes\n",
        encoding="utf-8",
    )
    with (
        Simulator({1: drivebus.Profile.load(tmp_path)}, transport="process", clock="virtual") as line,
        Bus(line) as bus,
    ):
        drive = bus.drive(1, "gd350")
        drive.write({"P00.11": 3.0, "P00.12": 4.0})
        with pytest.raises(drivebus.Refused, match="to write 2 words at 800BH") as refused:
            drive.write(BOTH)
        notes = getattr(refused.value, "__notes__", None)  # from Python 3.11 on
        assert notes is None or notes == [
            "P00.11, P00.12 shared that request. In force in the drive now: P00.11 = 3 s, P00.12 = 4 s"
        ]


def test_a_bad_value_and_nothing_is_sent(line: Simulator, drive: Drive) -> None:
    with pytest.raises(drivebus.NotAllowed, match=r"P00\.12"):
        drive.write({"P00.11": 10.0, "P00.12": 4000.0})
    assert sent(line) == []
