"""What a manual says of signs, degrees and ends by `drivebus profiles new`: a made-up one, as a technician pasted it.

A frequency that is below zero in reverse was read as one of six hundred hertz, and a stop that had worked as none.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

import drivebus
from drivebus import Simulator
from drivebus.cli import cli

from .conftest import NO_PTY
from .test_profile_interview import asked

ASKED_FOR = """\
Address   Name               One count    Remarks
2A80h     Condition          -            0 stands, 1 turns forwards,
                                          2 turns backwards, 9 fault
2A81h     Fault              -            see 5, 0 if none
2A82h     Motor frequency    0.01 Hz      negative backwards
2A83h     Motor current      0.1 A
2A85h     Heat sink          1 degree C   signed
"""
SETTINGS = """\
No.  Address  Name                        From  To     Works  Count
F01  2B01h    Where orders come from      0     3      0      1
F07  2B07h    Top speed                   20.0  400.0  60.0   0.1 Hz
F08  2B08h    Stopping time (F07 to 0)    0.1   600.0  8.0    0.1 s
"""
MERIDIAN = [
    *("Meridian M7", "issue C", "-", *ASKED_FOR.splitlines(), ".", "7", "-", *SETTINGS.splitlines(), ".", "9", ""),
    *("2A00h", "6", "11h", "12h", "10h", "20h", "80h", "6", "y"),
    *("2A01h", "6", "20000 = F07", "6"),
    *("condition", "number", "1", "2", "0", "9"),
    *("motor_frequency", "fault", "F01=3", "", "F08", "F07", "", "", "", "both", "8", "4", "9600 8N2 3", "4"),
]


@pytest.fixture
def there(tmp_path: Path) -> Path:
    return tmp_path / "m7"


@NO_PTY
def test_what_is_below_zero_backwards_is_shown_so(there: Path) -> None:
    done = asked(there, MERIDIAN)
    assert done.exit_code == 0, done.output
    profile = drivebus.Profile.load(there)
    frequency, heat = profile.describe("motor_frequency"), profile.describe("heat_sink")
    assert (frequency.signed, frequency.scale) == (True, 100)
    assert (heat.unit, heat.scale, heat.signed) == ("°C", 1, True)
    top = profile.describe("F07")
    assert (top.low, top.high, top.default, top.unit) == (20.0, 400.0, 60.0, "Hz")
    assert profile.functions == [3, 6, 16]
    with Simulator({3: there}, transport="pty") as line:
        with drivebus.Bus(line.port) as bus:
            drive = bus.drive(3, profile=there)
            drive.prepare_control(store=True)
            drive.write({"F08": 0.1}, store=True)
            drive.run(25.0, reverse=True)
            drive.wait_for_speed(25.0, timeout=60.0)
        words = ["--port", line.port, "-u", "3", "--profile", str(there), "read", "motor_frequency"]
        read = CliRunner().invoke(cli, words, prog_name="drivebus")
        assert (read.exit_code, "-25.00" in read.stdout) == (0, True), read.output


def test_a_frequency_of_which_no_table_tells_is_asked_for_its_sign(there: Path) -> None:
    unsaid = [line.replace("negative backwards", "").rstrip() if "Motor freq" in line else line for line in MERIDIAN]
    place = unsaid.index("motor_frequency") + 1
    for answer, signed in (("n", False), ("y", True)):
        folder = there.with_name(answer)
        done = asked(folder, [*unsaid[:place], "", answer, *unsaid[place:]])
        assert done.exit_code == 0, done.output
        assert drivebus.Profile.load(folder).describe("motor_frequency").signed is signed


def test_what_is_no_page_is_asked_again(there: Path) -> None:
    place = MERIDIAN.index("7")
    done = asked(there, [*MERIDIAN[:place], "-", "abc", *MERIDIAN[place:]])
    assert done.exit_code == 0, done.output
    assert '"-" is no page' in done.stderr
    assert '"abc" is no page' in done.stderr


def test_a_value_outside_its_table_is_asked_again(there: Path) -> None:
    place = MERIDIAN.index("F01=3")
    done = asked(there, [*MERIDIAN[:place], "F01=7", *MERIDIAN[place:]])
    assert done.exit_code == 0, done.output
    assert "F01 is from 0 to 3 by its table: it cannot be 7" in done.stderr
