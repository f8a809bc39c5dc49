"""Words that change places: each of these units runs by a word that stops, coasts or resets a unit of another family.

Where each is printed stands in `tests/vectors/families.toml`.
"""

from __future__ import annotations

from contextlib import suppress

import pytest

import drivebus
from drivebus import Bus, NotAllowed, Simulator

from .test_makers import written

SAME_WORD = [
    # Where, the word, and what it means to whom.
    (0x2000, 5, {"gd350": "stop", "md500": "coast", "eds300": "run in the direction in force"}),
    (0x2000, 6, {"gd350": "coast", "md500": "stop", "eds300": "stop"}),
    (0x2000, 7, {"gd350": "reset_fault", "eds300": "run_forward"}),
    (0x1000, 1, {"chf100a": "run_forward", "saj8000m": "run_forward"}),
    (0x1001, 3, {"sunfar-e300": "stop"}),
]


@pytest.mark.parametrize(("address", "word", "means"), SAME_WORD)
def test_the_same_word_at_the_same_place(address: int, word: int, means: dict[str, str]) -> None:
    for family, meaning in means.items():
        assert drivebus.Profile.builtin(family).command_registers()[address][word] == meaning


@pytest.mark.parametrize("unit", ["eds300", "sunfar-e300"])
@pytest.mark.parametrize("named", ["gd350", "gd600", "gd3000", "chf100a", "saj8000m", "ms300", "a1000", "vfd500"])
def test_named_as_another_it_gets_neither_a_write_nor_a_reset(named: str, unit: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        line.drive(1).trip(8)
        drive = bus.drive(1, named, unverified=True)
        with pytest.raises(NotAllowed):
            drive.write_words(0x2000, 1, force=True)
        with suppress(NotAllowed, drivebus.Refused):
            drive.reset_fault()
        assert written(line) == []


def test_what_stops_a_goodrive_runs_an_eds300() -> None:
    """Why the right profile matters: `stop` asks nothing before it is sent."""
    with Simulator({1: "eds300"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.write(1, 0x2001, 1000)
        bus.write(1, 0x2000, 5)
        line.advance(1.0)
        assert line.drive(1).state == "forward"


def test_a_printed_frame_is_what_goes_out() -> None:
    """E300 manual, p. 66: forward at 40 Hz."""
    with Simulator({1: "sunfar-e300"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.drive(1, "sunfar-e300", unverified=True).run(40.0)
        sent = [data.hex(" ") for _, who, data in line.line.trace() if who == "master" and data[1] == 0x10]
    assert sent == ["01 10 10 01 00 02 04 00 01 01 90 af 9f"]


@pytest.mark.parametrize("unit", ["eds300", "sunfar-e300"])
def test_they_are_known_by_their_answers(unit: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.family, found.certainty) == (unit, "by answers")


def test_what_asks_of_a_unit_that_nobody_knows_stays_small() -> None:
    """One word of each signature is asked, and no more once it is refused."""
    with Simulator({1: "gd600"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        assert bus.identify(1).certainty == "unknown"
        asked = [data[2:4].hex() for _, who, data in line.line.trace() if who == "master" and data[1] == 0x03]
        # The first is asked twice: before anything is believed of a unit on a line just opened.
        assert list(dict.fromkeys(asked)) == [
            *("2103", "1900", "2104", "2108", "200b", "7000", "004b", "0020"),
            *("0502", "0037"),  # P05.02 is there
            *("0030", "2180", "d000", "045c", "0c81"),
            "006d",
            *("0003", "0000"),  # P00.03 is there, and no P00.00
            *("c417", "080e", "fd00", "2520", "091b", "083e", "1003", "1028", "008b", "006f", "0013"),
        ]
        assert len(asked) == 30
        # And input register 0000H, once for all: an H100 answers it, an A1000 and a V20 refuse it.
        inputs = [data[2:4].hex() for _, who, data in line.line.trace() if who == "master" and data[1] == 0x04]
        assert inputs == ["0000"]
        assert written(line) == []
