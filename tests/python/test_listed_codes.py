"""A profile whose codes say nothing of their addresses: the same work as with any other, from a name to a backup.

The unit is a simulated GD350, whose P00.03, P00.11 and P00.12 another maker would call otherwise.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import drivebus

TOML = """
name = "ex3"
title = "Example Drives EX-3"
kind = "inverter"
version = 1
source = "EX-3 manual, 1st edition"
[requests]
functions = [0x03, 0x06]
max_words = 8
source = "p. 9"
[parameters]
address = "listed"
source = "p. 12"
"""

PARAMETERS = """\
code,address,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source
22.02,0003H,Highest frequency,Hz,100,no,10,,400,,50,stop,,yes,,p. 20
C1-01,000BH,Acceleration,s,10,no,0,,3600,,10,run,,yes,,p. 21
DEC,0x000C,Deceleration,s,10,no,0,,3600,,10,run,,yes,,p. 21
"""


@pytest.fixture
def drive(tmp_path: Path) -> Iterator[drivebus.Drive]:
    folder = tmp_path / "ex3"
    folder.mkdir()
    for name, text in {
        "profile.toml": TOML,
        "parameters.csv": PARAMETERS,
        "registers.csv": "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n",
        "faults.csv": "code,mnemonic,label,cause,remedy,verified,note,source\n",
    }.items():
        (folder / name).write_text(text, encoding="utf-8")
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        yield bus.drive(1, profile=folder)


def test_they_are_read_by_their_codes(drive: drivebus.Drive) -> None:
    assert drive.read("22.02", "c1-01", "DEC") == {"22.02": 50.0, "c1-01": 10.0, "DEC": 10.0}
    with pytest.raises(drivebus.NotAllowed, match=r'ex3 has no "P00.11"'):
        drive.read("P00.11")


def test_a_backup_has_them_and_knows_their_groups(drive: drivebus.Drive, tmp_path: Path) -> None:
    path = tmp_path / "drive.toml"
    drive.backup(path)
    text = path.read_text(encoding="utf-8")
    assert [line.partition(" =")[0] for line in text.partition("[parameters]\n")[2].splitlines()] == [
        "22.02",
        "C1-01",
        "DEC",
    ]
    path.write_text(
        text.replace("value = 10.0, ", "value = 12.0, ").replace("raw = 100", "raw = 120"), encoding="utf-8"
    )
    assert [difference.code for difference in drive.diff(path)] == ["C1-01", "DEC"]
    planned = drive.restore(path, dry_run=True, groups=["C1"])
    assert [item.code for item in planned.having("planned")] == ["C1-01"]
