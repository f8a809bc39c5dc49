"""Families that share addresses and no words: no name of another sets or starts one, and its own name no other."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import pytest

from drivebus import Bus, DrivebusError, Simulator

from .starts import STARTS

EVERYTHING: dict[str, Callable[[Any], Any]] = {
    **STARTS,
    "prepare": lambda drive: drive.prepare_control(store=True),
    "stop": lambda drive: drive.stop(),
    "coast": lambda drive: drive.coast(),
    "jog stop": lambda drive: drive.jog_stop(),
}


class Unit(NamedTuple):
    """What makes it obey the bus, address and word; where its stop goes, as what it is named, and what halts it."""

    obeys: list[tuple[int, int]]
    command: int
    others: list[str]
    halts: frozenset[int] = frozenset({0})


UNITS = {
    # Commanded where it has parameters: the first seven.
    "e510": Unit(
        [(0x0002, 2), (0x0005, 5)],
        0x2501,
        [
            "a1000",
            "j1000",
            "acs355",
            "acs580",
            "fr-d700",
            "v20",
            "chf100a",
            "h100",
            "gd350",
            "ms300",
            "md500",
            "vfd500",
            "frenic",
        ],
    ),
    # The same, and those that have their command or setpoint at 1000H; the last takes the same words.
    "f510": Unit(
        [(0x0002, 2), (0x0005, 3)],
        0x2501,
        [
            *("a1000", "j1000", "acs355", "acs580", "fr-d700", "v20", "chf100a", "h100", "gd350", "ms300", "md500"),
            *("vfd500", "frenic", "saj8000m", "sunfar-e300", "vacon10", "smd", "e510"),
        ],
    ),
    # The first three have its status words.
    "gs2": Unit(
        [(0x0300, 3), (0x0400, 5)],
        0x091B,
        ["ms300", "vfd-e", "yl620", "a1000", "j1000", "acs355", "fr-d700", "h100", "gd350", "md500", "vfd500", "e510"],
    ),
    # The first three have its status words, and the fourth its registers of parameters, too.
    "gs4": Unit(
        [(0x0300, 3), (0x0400, 1)],
        0x2000,
        [
            *("ms300", "vfd-e", "yl620", "gs2", "a1000", "j1000", "acs355", "fr-d700", "h100", "gd350", "md500"),
            *("vfd500", "e510", "eds300"),
        ],
        halts=frozenset({1}),
    ),
    # The first takes its commands, and counts another setpoint.
    "vfd-b": Unit(
        [(0x0201, 3), (0x0200, 5)],
        0x2000,
        ["yl620", "gs2", "gd350", "md500", "vfd500", "e510", "eds300", "a1000", "acs355"],
        halts=frozenset({1}),
    ),
    # The first two have parameters where it is commanded; the others are commanded or set where it has something else.
    "vacon10": Unit(
        [(0x007C, 3), (0x0074, 2)],
        0x07D0,
        [
            "acs355",
            "acs580",
            "v20",
            "optidrive-e3",
            "fr-d700",
            "a1000",
            "j1000",
            "h100",
            "fc51",
            "fc202",
            "frenic",
            "gd350",
            "md500",
            "vfd500",
            "atv312",
        ],
        # Bit 3 coasts.
        frozenset({0, 8}),
    ),
    # The first two have its addresses; the others have parameters there.
    "optidrive-p2": Unit(
        [(0x006F, 4)],
        0x0000,
        [
            *("optidrive-e3", "dc1", "acs355", "acs580", "v20", "a1000", "fr-d700", "h100", "gd350", "gd600", "md500"),
            *("yl620", "chf100a", "vacon10", "sj200", "wj200", "e510", "f510", "smd"),
        ],
        frozenset({0, 8}),
    ),
    # The first has its addresses, and takes the same words but for a reverse; the others have parameters there.
    "dc1": Unit(
        [(0x008B, 3)],
        0x0000,
        [
            *("optidrive-e3", "acs355", "acs580", "v20", "a1000", "fr-d700", "h100", "gd350", "gd600", "md500"),
            *("yl620", "chf100a", "vacon10", "sj200", "wj200", "x200", "e510"),
        ],
        frozenset({0, 8}),
    ),
    # Commanded where a Yaskawa stores its parameters, and the others have one.
    "nowforever": Unit(
        [(0x0000, 2), (0x0002, 6)],
        0x0900,
        [
            "a1000",
            "j1000",
            "e510",
            "gs2",
            "gs4",
            "gd350",
            "vfd-e",
            "acs355",
            "frenic",
            "optidrive-e3",
            "h100",
            "cfw500",
        ],
    ),
    # A WJ200 stops by the same coil and has its direction the other way, an SJ200 runs by its direction. A place of a
    # coil is 10000H above its address.
    "x200": Unit(
        [],
        0x10000,
        [
            *("sj200", "wj200", "h100", "acs355", "a1000", "gd350", "gd600", "optidrive-e3", "dc1", "smd"),
            *("chf100a", "saj8000m", "ms300", "v20", "fr-d700", "vf-s15", "md500", "fc51"),
        ],
    ),
    "wj200": Unit([], 0x10000, ["x200", "sj200"]),
    "sj200": Unit([], 0x10001, ["x200", "wj200"]),
    "h100": Unit([(0x0001, 2), (0x0002, 2)], 0x1004B, ["x200"], frozenset({1})),
}
PAIRS = [(unit, other) for unit, known in UNITS.items() for other in known.others]


@pytest.mark.parametrize("what", EVERYTHING)
@pytest.mark.parametrize(("unit", "named"), PAIRS)
def test_by_another_name_nothing_of_it_is_set_or_started(unit: str, named: str, what: str) -> None:
    known = UNITS[unit]
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            for address, word in known.obeys:
                bus.write(1, address, [word] if unit == "nowforever" else word)
        line.drive(1).take_writes()
        before = line.drive(1).eeprom_writes
        with Bus(line) as bus, suppress(DrivebusError, ValueError):
            EVERYTHING[what](bus.drive(1, named, unverified=True))
        line.advance(10.0)
        drive = line.drive(1)
        assert (drive.state, drive.frequency, drive.eeprom_writes) == ("stopped", 0.0, before)
        assert {(place, word) for _, place, word in drive.writes()} <= {(known.command, word) for word in known.halts}


@pytest.mark.parametrize("what", EVERYTHING)
@pytest.mark.parametrize(("named", "unit"), PAIRS)
def test_by_its_name_nothing_of_another_is_set_or_started(unit: str, named: str, what: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus, suppress(DrivebusError, ValueError):
            EVERYTHING[what](bus.drive(1, named, unverified=True))
        line.advance(10.0)
        assert (line.drive(1).state, line.drive(1).frequency, line.drive(1).eeprom_writes) == ("stopped", 0.0, 0)
