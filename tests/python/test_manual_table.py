"""`drivebus profiles new --table`: a manual's table becomes registers, and what may mean two things is asked for."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from hypothesis import given
from hypothesis import strategies as st

import drivebus
from drivebus.cli import cli
from drivebus.cli.manual_table import ManualTable
from drivebus.cli.wrong_use import WrongUse

ACME = """\
Register address,Function description,Unit,Range,R/W
2000H,Control command (1: run; 5: stop),,1-8,W
2001H,Frequency setpoint,0.01Hz,0.00-400.00,R/W
2100H,Drive state,,,R
3001H,Bus voltage,0.1V,"0,0~2000,0",R
3002H,Torque,0.1%,-250.0 to 250.0,R
3003H-3005H,Reserved,,,
3001H,Bus voltage again,,,R
3007H,Current,0.05A,0-10,R
3008H,Bus voltage,V,,R
"""
"""As many Chinese manuals print it; the decimal commas are those of a spreadsheet in German."""


def new(folder: Path, text: str | bytes, *options: str) -> Result:
    file = folder / "table.csv"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    line = ["profiles", "new", str(folder / "acme"), "--table", str(file), "--source", "A1 manual, p. 42", *options]
    return CliRunner().invoke(cli, line)


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "acme/registers.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_table_becomes_registers(tmp_path: Path) -> None:
    done = new(tmp_path, ACME)
    assert done.exit_code == 0, done.output
    profile = drivebus.Profile.load(tmp_path / "acme")
    told = {
        row.name: (row.address, row.unit, row.scale, row.signed, row.low, row.high, row.access)
        for row in map(profile.describe, profile.names())
    }
    assert told == {
        "control_command": (0x2000, "", 1, False, 1, 8, "wo"),
        "frequency_setpoint": (0x2001, "Hz", 100, False, 0.0, 400.0, "rw"),
        "drive_state": (0x2100, "", 1, False, None, None, "ro"),
        "bus_voltage": (0x3001, "V", 10, False, 0.0, 2000.0, "ro"),
        "torque": (0x3002, "%", 10, True, -250.0, 250.0, "ro"),
        "current": (0x3007, "raw", 1, False, None, None, "ro"),
        "bus_voltage_2": (0x3008, "raw", 1, False, None, None, "ro"),
    }
    by_name = {row["name"]: row for row in rows(tmp_path)}
    assert {row["source"] for row in by_name.values()} == {"A1 manual, p. 42"}
    assert by_name["control_command"]["label"] == "Control command (1: run; 5: stop)"
    # A step of 0.05 A is no scale, and a voltage whose step is not printed has none: both are counts.
    assert (by_name["current"]["scale"], by_name["bus_voltage_2"]["scale"]) == ("", "")
    assert by_name["current"]["note"] == "the table has steps of 0.05; the table has the range 0-10"
    assert 'line 7 is left out: "3003H-3005H" is no address of one register' in done.stderr
    assert "line 8 is left out: its address is that of line 5" in done.stderr


def test_what_a_second_column_of_text_says_is_a_step_or_a_note(tmp_path: Path) -> None:
    text = (
        "Address,Contents,Meaning\n"
        "1400H,Operation command,0011H run forward\n"
        '1401H,Frequency reference,"0 - C01, in 0.1 Hz"\n'
        "1501H,Output frequency,0.1 Hz\n1502H,Output current,0.01 A\n1507H,Counter,\n"
    )
    assert new(tmp_path, text).exit_code == 0
    assert [(row["name"], row["unit"], row["scale"], row["note"]) for row in rows(tmp_path)] == [
        ("operation_command", "", "", "the table says '0011H run forward'"),
        ("frequency_reference", "", "", "the table says '0 - C01, in 0.1 Hz'"),
        ("output_frequency", "Hz", "10", ""),
        ("output_current", "A", "100", ""),
        # No column says that it has no unit.
        ("counter", "", "", ""),
    ]


@pytest.mark.parametrize(
    ("titles", "cells", "options", "wanted"),
    [
        ("Address (Hex),Name", "2100,State", [], ("holding", 0x2100)),
        ("Addr. (dec),Name", "2100,State", [], ("holding", 2100)),
        ("Modbus address,Name", "2100,State", ["--addresses", "hex"], ("holding", 0x2100)),
        ("Modbus address,Name", "2100,State", ["--addresses", "decimal"], ("holding", 2100)),
        ("Register,Name", "40001,State", [], ("holding", 0)),
        ("Register,Name", "30017,State", [], ("input", 16)),
        ("Register,Name", "402101,State", [], ("holding", 2100)),
        ("Address;Meaning", "0x1A;State", [], ("holding", 0x1A)),
        ("Address\tDescription", "1Ah\tState", [], ("holding", 0x1A)),
    ],
)
def test_addresses_as_manuals_write_them(
    tmp_path: Path, titles: str, cells: str, options: list[str], wanted: tuple[str, int]
) -> None:
    done = new(tmp_path, f"{titles}\n{cells}\n", *options)
    assert done.exit_code == 0, done.output
    [row] = rows(tmp_path)
    assert (row["table"], int(row["address"], 16)) == wanted


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        ("Address,Name\n2100,State\n", [], "may be hexadecimal or decimal"),
        ("Place,Name\n2100H,State\n", [], "no column of the table is an address: its first line has 'Place', 'Name'"),
        ("Address,Remark\n2100H,State\n", [], "no column of the table is a name"),
        ("", [], "its first line has nothing"),
        (ACME, ["--like", "gd350"], "give one of --like, --overlay and --table"),
    ],
)
def test_what_may_mean_two_things_is_asked_for(tmp_path: Path, text: str, options: list[str], said: str) -> None:
    done = new(tmp_path, text, *options)
    assert (done.exit_code, said in done.stderr) == (2, True), done.stderr
    assert not (tmp_path / "acme").exists()


def test_a_row_says_where_it_is_printed(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(ACME)
    line = ["profiles", "new", str(tmp_path / "acme"), "--table", str(tmp_path / "table.csv")]
    done = CliRunner().invoke(cli, line)
    assert (done.exit_code, "give --table with --source" in done.stderr) == (2, True)
    assert not (tmp_path / "acme").exists()


def test_a_range_that_does_not_fit_its_step_is_left_to_the_note(tmp_path: Path) -> None:
    text = "Address,Name,Unit,Range\n2001H,Setpoint,0.1Hz,0.00-400.05\n2002H,Percent,0.01%,5-1\n2003H,Big,1V,0-99999\n"
    assert new(tmp_path, text).exit_code == 0
    assert [(row["low"], row["high"], row["note"]) for row in rows(tmp_path)] == [
        ("", "", "the table has the range 0.00 to 400.05"),
        ("", "", "the table has the range 5 to 1"),
        ("", "", "the table has the range 0 to 99999"),
    ]


def test_names_that_are_alike_are_numbered_in_their_order() -> None:
    rows = "".join(f"{address:04X},Value 2\n" for address in range(3000)) + "F000,Value 2 17\n"
    names = [row.name for row in ManualTable().read(f"Address (hex),Name\n{rows}".encode(), "p. 1")]
    assert (names[:3], names[2999], names[3000]) == (
        ["value_2", "value_2_2", "value_2_3"],
        "value_2_3000",
        "value_2_17_2",
    )


PARAMETERS = """\
No.  Address  Parameter name        Setting range                              Default  Unit
P00.01  0001H  Run command source   0: keypad; 1: terminals; 2: bus            0        -
P00.03  0003H  Highest frequency    10.00-400.00                               50.00    0.01Hz
P00.11  000BH  Acceleration time    0.0-3600.0                                 depends  0.1s
P14.02  0E02H  Format (0: 8N1; 2: 8E1)  0-5                                    1        -
-  2000H  Control command           1-8                                        -        -
"""
"""As it comes out of a PDF file: gaps of two spaces divide the cells."""

BARS = """\
| Code | Name | Range | Factory setting | Unit | R/W |
| --- | --- | --- | ---: | --- | --- |
| 00-01 | Source | 0=keypad, 1=terminals | 0 | | R/W |
| 00-08 | Preset frequency | 0.00-50.00 | 50.00 | 0.01Hz | R/W |
| 01-00 | Running frequency | | | 0.01Hz | R |
| F0-02 | Of the letter nobody knows the place | | | | R |
"""
"""As a web page has it."""


def parameters(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / "acme/parameters.csv").open(encoding="utf-8", newline="") as file:
        return {row["code"]: row for row in csv.DictReader(file)}


def test_what_has_a_code_is_a_parameter(tmp_path: Path) -> None:
    done = new(tmp_path, PARAMETERS)
    assert done.exit_code == 0, done.output
    assert "Of the table: 1 row in registers.csv, 4 rows in parameters.csv." in done.stdout
    known = drivebus.Profile.load(tmp_path / "acme")
    told = {
        code: (row.address, row.unit, row.scale, row.low, row.high, row.default, dict(row.choices))
        for code in parameters(tmp_path)
        for row in [known.describe(code)]
    }
    assert told == {
        "P00.01": (0x0001, "", 1, None, None, 0, {0: "keypad", 1: "terminals", 2: "bus"}),
        "P00.03": (0x0003, "Hz", 100, 10.0, 400.0, 50.0, {}),
        "P00.11": (0x000B, "s", 10, 0.0, 3600.0, None, {}),
        "P14.02": (0x0E02, "", 1, None, None, 1, {0: "8N1", 2: "8E1"}),
    }
    assert known.describe("control_command").address == 0x2000
    # Whether a parameter can be written while the motor turns, no column says.
    assert {row["access"] for row in parameters(tmp_path).values()} == {"unknown"}


@pytest.mark.parametrize("from_the_input", [False, True])
def test_a_table_in_bars_whose_codes_tell_the_addresses(tmp_path: Path, from_the_input: bool) -> None:
    refused = new(tmp_path, BARS)
    assert (refused.exit_code, "give --addresses group.index" in refused.stderr) == (2, True)
    if from_the_input:
        line = ["profiles", "new", str(tmp_path / "acme"), "--table", "-", "--source", "A1 manual"]
        done = CliRunner().invoke(cli, [*line, "--addresses", "group.index"], input=BARS)
    else:
        done = new(tmp_path, BARS, "--addresses", "group.index")
    assert done.exit_code == 0, done.output
    told = {code: (row["address"], row["choices"], row["access"]) for code, row in parameters(tmp_path).items()}
    assert told == {
        "00-01": ("0x0001", "0=keypad;1=terminals", "unknown"),
        "00-08": ("0x0008", "", "unknown"),
        "01-00": ("0x0100", "", "ro"),
    }
    assert 'line 6 is left out: "F0-02" is no code of one register' in done.stderr


def test_a_factory_value_that_does_not_fit_is_left_to_the_note(tmp_path: Path) -> None:
    text = "Code,Address,Name,Unit,Range,Default\nP00.03,0003H,Highest,0.1Hz,10.0-400.0,500.0\n"
    assert new(tmp_path, text).exit_code == 0
    [row] = parameters(tmp_path).values()
    assert (row["default"], row["high"], row["note"]) == ("", "400.0", "the table has the factory value 500.0")


@pytest.mark.parametrize("source", ["A1 manual,\np. 42", " A1 manual,\t\np. 42 "])
def test_a_source_is_one_line(tmp_path: Path, source: str) -> None:
    text = "Address (hex),Name,Unit,Range\n2000,A,1V,0-99999\n2001,B,1V,0-5\n2002,C,1V,0-99999\n"
    assert new(tmp_path, text, "--source", source).exit_code == 0
    assert [(row["high"], row["source"]) for row in rows(tmp_path)] == [
        ("", "A1 manual, p. 42"),
        ("5", "A1 manual, p. 42"),
        ("", "A1 manual, p. 42"),
    ]


def test_a_source_that_says_nothing_is_none(tmp_path: Path) -> None:
    done = new(tmp_path, ACME, "--source", " ")
    assert (done.exit_code, "give --table with --source" in done.stderr) == (2, True)
    assert not (tmp_path / "acme").exists()


@given(st.lists(st.lists(st.text(max_size=12), min_size=2, max_size=6), max_size=12))
def test_no_table_brings_it_down(cells: list[list[str]]) -> None:
    text = "Address (hex),Name,Unit,Range,R/W\n" + "\n".join(",".join(row) for row in cells)
    try:
        table = ManualTable()
        table.read(text.encode("utf-8", "surrogatepass"), "p. 1")
    except (drivebus.NotAllowed, drivebus.BadArgument):
        return
    places = [(row.table, row.address) for row in table.rows]
    assert len(places) == len({*places}) == len({row.name for row in table.rows})


@pytest.mark.parametrize(
    ("said", "choices"),
    [
        ("0 keypad 1 terminals 2 bus", {0: "keypad", 1: "terminals", 2: "bus"}),
        ("0 off, 1 on", {0: "off", 1: "on"}),
        ("0 keypad 1 terminals 3 bus", {0: "keypad", 1: "terminals", 3: "bus"}),
        # Values and their units, ends of a range, a choice alone, and numbers that do not count up.
        ("0 Hz 60 Hz", {}),
        ("0 to 10 V", {}),
        ("0 V 1 A", {}),
        ("1 keypad", {}),
        ("1 run 0 stop", {}),
        ("5 slow 6 fast", {}),
        ("0 ... 3", {}),
    ],
)
def test_values_without_signs_are_taken_where_they_count_up(said: str, choices: dict[int, str]) -> None:
    table = f"Code,Address,Name,Range\nP00.01,0001H,Source,{said!r}\n".replace("'", '"')
    (row,) = ManualTable().read(table.encode(), "p. 1")
    assert row.choices == choices


@pytest.mark.parametrize(
    ("said", "access"),
    [
        ("any time", "run"),
        ("while running", "run"),
        ("stopped", "stop"),
        ("Only when stopped", "stop"),
        ("R", "ro"),
        # That it can be written does not tell when.
        ("R/W", "unknown"),
        ("yes", "unknown"),
        ("not while running", "unknown"),
    ],
)
def test_when_a_parameter_may_be_written_is_taken_where_it_is_said(said: str, access: str) -> None:
    (row,) = ManualTable().read(f"Code,Address,Name,Change\nP00.01,0001H,Source,{said}\n".encode(), "p. 1")
    assert row.access == access


def test_a_cell_goes_on_in_the_next_line_and_only_there() -> None:
    text = """\
Address  Name           Unit
1000H    Speed          0.01 Hz
         of the motor
1001H    Current        0.1 A,
                        signed
1002H    Torque         0.1 %, up to 300
"""
    rows = ManualTable().read(text.encode(), "p. 1")
    assert [(row.label, row.unit, row.scale, row.signed) for row in rows] == [
        ("Speed of the motor", "Hz", 100, False),
        ("Current", "A", 10, True),
        ("Torque", "%", 10, False),
    ]
    assert rows[2].notes == ["the table says 'up to 300'"]


def test_what_no_column_is_for_is_named_and_titles_that_stand_too_close() -> None:
    table = ManualTable()
    table.read(b"Address,Name,Group\n1000H,Speed,A\n", "p. 1")
    assert table.unused == ["Group"]
    with pytest.raises(WrongUse, match='"Register Name" may be two columns'):
        table.read(b"Code  Register Name   Unit\nP00.01  1000H  Speed  Hz\n", "p. 1")


@pytest.mark.parametrize("high", ["P00.03", "P09.99"])
def test_a_parameter_may_be_the_end_of_a_range_if_there_is_such(tmp_path: Path, high: str) -> None:
    text = (
        f"Address,Code,Name,Unit,Range\n1001H,,Speed,0.01 Hz,0 ... {high}\n"
        "0003H,P00.03,Highest frequency,0.01 Hz,10.00-400.00\n"
    )
    assert new(tmp_path, text).exit_code == 0
    (row,) = rows(tmp_path)
    known = high == "P00.03"
    assert (row["high_from"], row["note"]) == ((high, "") if known else ("", "the table has the range 0 to P09.99"))


GOING_ON = [
    ["No.", "Addr.", "Description", "Unit"],
    ["", "", "of the drive", "or step"],
    ["P00.01", "0001H", "Speed", "0.01 Hz"],
    ["", "", "of the motor", ""],
    ["", "", "in the field", ""],
    ["", "1000H", "Torque", "0.1 %,"],
    ["", "", "", "signed"],
    ["P00.02", "0002H", "Current", "0.1 A"],
]
"""A table whose cells go on in the next line: below the titles, in one column, in another; and a row without a code."""


@pytest.mark.parametrize("before", ["", "\n\n"])
@pytest.mark.parametrize("form", ["bars", "bars that end early", "gaps"])
def test_cells_go_on_in_the_same_way_however_a_table_is_pasted(form: str, before: str) -> None:
    if form == "gaps":
        lines = ["".join(cell.ljust(18) for cell in row).rstrip() for row in GOING_ON]
    else:
        lines = [f"| {' | '.join(row)} |" for row in GOING_ON]
    if form == "bars that end early":
        lines = [line.rstrip(" |") for line in lines]
    table = ManualTable()
    rows = table.read((before + "\n".join(lines)).encode(), "p. 1")
    assert [(row.code, row.address, row.label, row.unit, row.scale, row.signed) for row in rows] == [
        ("P00.01", 0x0001, "Speed of the motor in the field", "Hz", 100, False),
        ("", 0x1000, "Torque", "%", 10, True),
        ("P00.02", 0x0002, "Current", "A", 10, False),
    ]
    assert [said for _, said in table.left_out] == ['"" is no address of one register']
