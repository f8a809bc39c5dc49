"""A drive that has a word where it has nothing: an Altivar 71 among others of a read, an Altivar 320 always.

Altivar 71 integrated Modbus (Schneider 1755863), p. 39: a read of several words has 8000H for those that are not there,
and is refused with 02H where none of them is. 3209 is in its list of parameters (S383, V6.7); 3210 is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivebus import BadAnswer, Bus, Drive, Profile, Refused, Simulator

HEAD = "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n"
ROW = "0x0C8A,made_up,What it has not,A,10,no,,,,ro,yes,,made up\n"


@pytest.fixture(params=["atv71", "atv320"])
def pair(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Bus, Drive]]:
    """A drive whose profile has one register more than it, and its line."""
    (tmp_path / "profile.toml").write_text(
        f'name = "more"\nsource = "made up"\nversion = 1\n[overlay]\nprofile = "{request.param}"\n', encoding="utf-8"
    )
    (tmp_path / "registers.csv").write_text(HEAD + ROW, encoding="utf-8")
    with Simulator({1: request.param}, transport="process", clock="virtual") as line, Bus(line) as bus:
        yield bus, bus.drive(1, Profile.load(tmp_path), unverified=True)


def test_no_value_is_made_of_it(pair: tuple[Bus, Drive]) -> None:
    _, drive = pair
    said = "unit 1 has no made_up: the word that it answered stands for nothing in its family. Leave made_up out"
    with pytest.raises(BadAnswer) as caught:
        drive.read("drive_thermal_state", "made_up")
    assert (str(caught.value), caught.value.unit) == (said, 1)
    # Alone an Altivar 71 refuses it.
    with pytest.raises(Refused if drive.profile.family == "atv71" else BadAnswer):
        drive.read("made_up")
    assert drive.read("drive_thermal_state") >= 0


def test_a_poll_has_an_error_in_its_place_and_its_table_a_gap(pair: tuple[Bus, Drive]) -> None:
    bus, drive = pair
    with bus.poll({drive: ["drive_thermal_state", "made_up"]}, interval=0.1) as poll:
        batch = poll.batch(2)
    for sample in batch:
        assert isinstance(sample.missing, BadAnswer)
        assert "made_up" in str(sample.missing)
    (table,) = batch.to_numpy().values()
    assert all(math.isnan(value) for value in table["made_up"])
    assert not any(math.isnan(value) for value in table["drive_thermal_state"])
