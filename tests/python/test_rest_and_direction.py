"""A frequency below zero is a motor that turns, and a state word that says "stopped" too early proves no rest.

The output frequency of an Altivar 312 and of a V20 is signed: it is below zero in reverse. No page at hand says that
the state words of an Altivar 312 and of an ACS355 tell a motor on its ramp as running.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import drivebus
from drivebus import Bus, Drive, Profile, Simulator, State, Unconfirmed

SIGNED = {"atv12": None, "atv312": None, "atv71": None, "v20": {"base_frequency": "50 Hz"}}


@contextmanager
def ready(family: str) -> Iterator[tuple[Simulator, Drive]]:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, family, unverified=True, variants=SIGNED[family])
        drive.prepare_control(store=True)
        yield line, drive


every_signed = pytest.mark.parametrize("family", SIGNED)


@every_signed
def test_a_motor_in_reverse_comes_to_its_speed(family: str) -> None:
    with ready(family) as (_, drive):
        drive.run(10.0, reverse=True)
        seen = drive.wait_for_speed(10.0, timeout=30)
        assert (seen.state, seen.frequency) == (State.REVERSE, 10.0)


@every_signed
def test_a_motor_in_reverse_is_no_standstill(family: str) -> None:
    with ready(family) as (line, drive):
        drive.run(10.0, reverse=True)
        drive.wait_for_speed(10.0, timeout=30)
        drive.stop(confirm=60.0)
        drive.wait_until_stopped(timeout=30)
        assert line.drive(1).frequency == 0.0


@every_signed
def test_turning_round_is_confirmed_while_the_motor_slows_down(family: str) -> None:
    with ready(family) as (line, drive):
        drive.run(40.0, reverse=True)
        drive.wait_for_speed(40.0, timeout=60)
        drive.run(40.0)
        assert -40.0 < line.drive(1).frequency < 0.0


# At 2100H of a GD350, 1 is forward and 3 is stopped. Told so, the motor seems to rest on its ramp already.
TOO_EARLY = """\
name = "early"
title = "A word that says stopped too early"
version = 1
source = "none: a drive that does not exist"

[overlay]
profile = "gd350"

[state]
register = "status_word_1"
source = "none: a drive that does not exist"

[state.codes]
stopped = 1
forward = 2
power_off = 3
fault = 4
"""


@pytest.fixture
def early(tmp_path: Path) -> Path:
    (tmp_path / "profile.toml").write_text(TOO_EARLY, encoding="utf-8")
    for table in ("registers", "parameters", "faults"):
        [head] = (Path(__file__).parents[2] / f"crates/drives/profiles/gd350/{table}.csv").read_text().splitlines()[:1]
        (tmp_path / f"{table}.csv").write_text(f"{head}\n", encoding="utf-8")
    return tmp_path


@pytest.mark.parametrize("by_frequency", [False, True])
def test_a_stop_that_is_ignored_is_believed_or_not_as_the_profile_says(early: Path, by_frequency: bool) -> None:
    if by_frequency:
        text = TOO_EARLY.replace(
            'register = "status_word_1"\n', 'register = "status_word_1"\nrest_by_frequency = true\n'
        )
        (early / "profile.toml").write_text(text, encoding="utf-8")
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.drive(1).prepare_control()
        bus.write(1, 0x2000, [1, 2000])
        line.advance(30.0)
        assert line.drive(1).frequency == 20.0
        bus.write(1, 0x8001, 0)  # P00.01 in RAM: from here on it hears its keypad alone
        drive = bus.drive(1, Profile.load(early))
        if by_frequency:
            with pytest.raises(Unconfirmed, match="stop was sent to unit 1, and its state does not show it"):
                drive.stop()
        else:
            drive.stop()
        assert line.drive(1).frequency == 20.0


@pytest.mark.parametrize("family", drivebus.profiles())
def test_where_no_page_says_that_a_ramp_is_told_the_frequency_is_looked_at(family: str) -> None:
    unsure = (
        "acs355",
        "acs580",
        "atv12",
        "atv312",
        "atv320",
        "atv600",
        "atv71",
        "cfw500",
        "e510",
        "f510",
        "fc202",
        "fr-d700",
        "frenic",
        "h100",
        "j1000",
        "nowforever",
        "optidrive-e3",
        "optidrive-p2",
        "dc1",
        "sj200",
        "x200",
        "smd",
        "starvert",
        "vacon10",
        "vf-s15",
        "yl620",
    )
    assert Profile.builtin(family).rest_by_frequency() is (family in unsure)
