"""`drivebus.toml`: what it says, and every mistake with its line."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus.site import FILE, Site, SiteLine

WHOLE = """
[lines.hall]
port = "/dev/ttyUSB0"
baud = 9600
format = "8n1"
rs485 = "kernel"

[lines.yard]
port = "socket://10.0.0.5:4001"

[drives.pump1]
line = "hall"
unit = 1
profile = "gd350"
variants = { speed_unit = "Hz" }

[drives.pump2]
line = "hall"
unit = 2
profile = "./acme"
unverified = true
read_only = true

[drives.fan]
line = "yard"
unit = 1

[groups]
pumps = ["pump1", "pump2", "pump1"]
"""


def load(tmp_path: Path, text: str) -> Site:
    file = tmp_path / FILE
    file.write_text(text, encoding="utf-8")
    return Site.load(file)


def complaints(tmp_path: Path, text: str) -> list[str]:
    """What is said of *text*, each with its line and without the file's name."""
    with pytest.raises(drivebus.NotAllowed) as raised:
        load(tmp_path, text)
    path = re.escape(str(tmp_path / FILE))
    return re.findall(rf"^{path}:(\d+: .*)$", str(raised.value), re.MULTILINE)


def test_what_it_says(tmp_path: Path) -> None:
    site = load(tmp_path, WHOLE)
    assert site.lines == {
        "hall": SiteLine("hall", "/dev/ttyUSB0", 9600, "8N1", "kernel"),
        "yard": SiteLine("yard", "socket://10.0.0.5:4001"),
    }
    pump1, pump2, fan = site.drives.values()
    assert (pump1.name, pump1.line.name, pump1.unit, pump1.profile) == ("pump1", "hall", 1, "gd350")
    assert pump1.variants == {"speed_unit": "Hz"}
    assert (pump2.unverified, pump2.read_only) == (True, True)
    assert pump2.profile == str(tmp_path / "acme"), "a folder is meant from where the file is"
    assert (fan.line.name, fan.profile, fan.read_only) == ("yard", None, False)
    assert site.groups == {"pumps": (pump1, pump2)}


def test_drives_are_chosen_by_name_and_by_group_each_once(tmp_path: Path) -> None:
    site = load(tmp_path, WHOLE)
    assert [drive.name for drive in site.select(["fan", "pumps", "pump1"])] == ["fan", "pump1", "pump2"]
    with pytest.raises(drivebus.NotAllowed, match=r'has no drive or group "pomps"; did you mean .pumps.\?'):
        site.select(["pomps"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[lines.hall]\nbaud = 9600", ["1: lines.hall has no port"]),
        ('[lines.hall]\nport = "a"\n\nbaud = 0', ["4: baud = 0: not a whole number from 1 to 100000000"]),
        ('[lines.hall]\nport = "a"\nbaud = true', ["3: baud = True: not a whole number from 1 to 100000000"]),
        ('[lines.hall]\nport = ""', ['2: port = "": not a text']),
        (
            '[lines.hall]\nport = "a"\nformat = "8X1"',
            ['3: format = "8X1": give data bits (7, 8), parity (N, E, O) and stop bits (1, 2), such as "8E1"'],
        ),
        ('[lines.hall]\nport = "a"\nrs485 = 1', ['3: rs485 = 1: allowed is "kernel", "rts", "auto"']),
        (
            '[lines.hall]\nprot = "a"',
            [
                "1: lines.hall has no port",
                '2: "prot" is not known here; did you mean "port"?; allowed is "port", "baud", "format", "rs485", '
                '"reserved"',
            ],
        ),
        ('[drives.pump1]\nline = "hall"\nunit = 1', ['2: there is no line "hall"; there are none']),
        (
            '[lines.hall]\nport = "a"\n[drives.pump1]\nline = "hal"\nunit = 248',
            ['4: there is no line "hal"; there is "hall"', "5: unit = 248: not a whole number from 1 to 247"],
        ),
        ('[lines.hall]\nport = "a"\n[drives.p]\nline = "hall"', ["3: drives.p has no unit"]),
        (
            '[lines.hall]\nport = "a"\n[drives."1st"]\nline = "hall"\nunit = 1',
            ['3: "1st" is not a name: a letter, then letters, digits, "_" and "-"'],
        ),
        ('[groups]\npumps = "pump1"', ['2: pumps is a list of drives, such as ["pump1"]']),
        ('[groups]\npumps = ["pump1"]', ['2: there is no drive "pump1"']),
        (
            "[drive.pump1]",
            [
                '1: "drive" is not known here; did you mean "drives"?; allowed is "lines", "drives", "groups", '
                '"share", "poll", "spool", "prometheus", "postgres", "mqtt", "sparkplug", "web", "people"'
            ],
        ),
        ("lines = 3", ["1: lines is a table of tables, such as [lines.NAME]"]),
        ("[lines]\nhall = 3", ["2: lines.hall is a table: [lines.hall]"]),
        ("groups = 3", ['1: groups is a table of lists, such as pumps = ["pump1", "pump2"]']),
        (
            '[lines.h]\nport = "a"\n[drives.p]\nline = "h"\nunit = 1\nvariants = 3\nread_only = "yes"',
            [
                '6: variants = 3: not a table of texts, such as { speed_unit = "Hz" }',
                '7: read_only = "yes": neither true nor false',
            ],
        ),
        (
            '[lines.h]\nport = "a"\n[drives.p]\nline = "h"\nunit = 1\n[groups]\np = ["p"]',
            ['7: "p" is a drive already; give the group another name'],
        ),
    ],
)
def test_a_mistake_is_told_with_its_line_and_what_is_allowed(tmp_path: Path, text: str, said: list[str]) -> None:
    assert complaints(tmp_path, text) == said


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"[lines.hall\n", r"drivebus\.toml:1: not TOML: "),
        (b'[lines.hall]\nport = "a', r"drivebus\.toml(:2|, at its end): not TOML: "),
        (b"\xff\xfe", "not text in UTF-8"),
        (b"a = " + b"[" * 5000, "nested too deeply|not TOML"),
        (b"#" * 1_000_001, "more than 1000000 bytes"),
    ],
)
def test_what_is_not_such_a_file_is_told(tmp_path: Path, data: bytes, said: str) -> None:
    file = tmp_path / FILE
    file.write_bytes(data)
    with pytest.raises(drivebus.NotAllowed, match=said):
        Site.load(file)


def test_a_file_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path, "a\0b"):
        with pytest.raises(drivebus.NotAllowed, match="cannot be read"):
            Site.load(path)


@given(st.text(alphabet="[]={}\"'.,#\n abdeginlprstu0123456789", max_size=200))
def test_whatever_it_holds_nothing_else_is_raised(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    file = tmp_path_factory.getbasetemp() / "any.toml"
    file.write_text(text, encoding="utf-8")
    with suppress(drivebus.NotAllowed):
        site = Site.load(file)
        assert set(site.drives) >= {drive.name for group in site.groups.values() for drive in group}
