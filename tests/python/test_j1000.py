"""Yaskawa J1000: the frames of its manual, what an Enter command stores, and how it stands beside an A1000.

J1000 User Manual SIEP C710606 33A, pp. 197, 198 and 206; J1000 Technical Manual SIEP C710606 31B, p. 231.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, NotAllowed, Simulator

COMMAND_SOURCE, ENTER = 0x0181, 0x0900


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "j1000"}, transport="process", clock="virtual") as simulator:
        yield simulator


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "j1000", unverified=True, variants={"speed_unit": "Hz"})


def sent(line: Simulator) -> list[tuple[int, int]]:
    return [(place, word) for _, place, word in line.drive(1).take_writes()]


def test_the_frame_of_the_manual_starts_it(line: Simulator) -> None:
    """01 10 00 01 00 02 04 00 01 02 58 63 39, which the manual says is 60.0 Hz (p. 198)."""
    with Bus(line) as bus:
        assert bus.transact(1, bytes.fromhex("10 00 01 00 02 04 00 01 02 58")).hex(" ") == "10 00 01 00 02"
        assert line.drive(1).state == "forward"


def test_the_words_of_the_manual_are_read_at_once(line: Simulator) -> None:
    """02 03 00 20 00 04 asks for status signals, error details, data link and frequency reference (p. 197)."""
    with Bus(line) as bus:
        assert len(bus.read(1, 0x0020, 4)) == 4


@pytest.mark.parametrize(
    ("request_", "exception"),
    [
        ("06 00 01 00 00", 0x01),
        ("03 09 00 00 01", 0x02),
        ("10 01 81 00 01 02 00 09", 0x21),
        ("10 00 20 00 01 02 00 00", 0x22),
    ],
)
def test_it_refuses_as_its_manual_says(line: Simulator, request_: str, exception: int) -> None:
    """P. 206, and p. 231 of what cannot be read."""
    asked = bytes.fromhex(request_)
    with Bus(line) as bus, pytest.raises(drivebus.Refused) as refused:
        bus.transact(1, asked)
    assert refused.value.code == exception


def test_what_is_written_stays_in_ram(line: Simulator, drive: Drive) -> None:
    drive.write("b1-02", 1)
    assert sent(line) == [(COMMAND_SOURCE, 1)]
    assert line.drive(1).eeprom_writes == 0
    line.drive(1).power_cycle()
    assert drive.read("b1-02") == 2


def test_an_enter_command_stores_it(line: Simulator, drive: Drive) -> None:
    """0 at 0900H, which is not read before or after (p. 231)."""
    drive.write("b1-02", 1, store=True)
    assert sent(line) == [(COMMAND_SOURCE, 1), (ENTER, 0)]
    line.drive(1).power_cycle()
    assert drive.read("b1-02") == 1
    asked = [data[2:4].hex() for _, who, data in line.line.trace() if who == "master" and data[1] == 0x03]
    assert asked.count("0900") <= 1, "as its signature asks, at most"


def test_it_does_not_run_by_what_is_printed_alone(line: Simulator) -> None:
    """The word that stops it is on no page of its own, nor which number of o1-03 is which unit."""
    with Bus(line) as bus:
        drive = bus.drive(1, "j1000")
        with pytest.raises(NotAllowed, match="could not be stopped"):
            drive.run(20.0)
    assert sent(line) == []


def test_it_is_known_by_its_answers(line: Simulator) -> None:
    with Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == ("j1000", "by answers")


@pytest.mark.parametrize(("named", "unit"), [("a1000", "j1000"), ("j1000", "a1000")])
def test_a_halt_by_the_name_of_its_sister_stops_it(named: str, unit: str) -> None:
    """Both take the same words, so that it matters to nothing that moves which of them it is."""
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        own = bus.drive(1, unit, unverified=True, variants={"speed_unit": "Hz"})
        own.run(20.0)
        bus.drive(1, named, unverified=True).stop()
        assert line.drive(1).state == "stopped"
        assert line.drive(1).eeprom_writes == 0


TENTHS = """name = "tenths"
source = "made up"
version = 1

[overlay]
profile = "j1000"

[variants.speed_unit]
parameter = "o1-03"
verified = false
note = "01 10 00 01 00 02 04 00 01 02 58 63 39 is 60.0 Hz"
source = "J1000 User Manual SIEP C710606 33A (manualslib 795817), p. 198"

[variants.speed_unit.choices]
"0.1 Hz" = { value = 0, unit = "Hz", scale = 10, signed = false, low = 0.0, high = 400.0 }
"""


def test_one_that_counts_tenths_has_a_profile_of_its_own(line: Simulator, tmp_path: Path) -> None:
    """0258H for 60.0 Hz: what the page of its manual prints, and other pages of its sisters do not."""
    folder = tmp_path / "tenths"
    folder.mkdir()
    (folder / "profile.toml").write_text(TENTHS, encoding="utf-8")
    with Bus(line) as bus:
        drive = bus.drive(1, folder, unverified=True, variants={"speed_unit": "0.1 Hz"})
        drive.run(60.0)
    assert (0x0002, 0x0258) in sent(line)
