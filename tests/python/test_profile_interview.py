"""`drivebus profiles new` asks: what a manual says becomes a profile that is sound, and what is unclear is asked again.

The manuals are made up; what stands in them is typed here twice, as an answer and as what must come of it.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import drivebus
from drivebus import Simulator
from drivebus.cli import cli
from drivebus.cli.interview_registers import FAULT, FREQUENCY, SETPOINT, STATE
from drivebus.cli.manual_cells import TableRow
from drivebus.cli.row_kinds import against

from .conftest import NO_PTY

REGISTERS = """\
Address,Name,Unit,R/W
1000H,Command,,W
1001H,Speed setpoint,0.01Hz,R/W
1100H,State,,R
1101H,Fault number,,R
1200H,Output frequency,0.01Hz,R
1201H,Output current,0.1A,R
"""
PARAMETERS = """\
Code    Address  Name               Range                               Default
P00.01  0001H    Command source     0: keypad, 1: terminals, 2: bus     0
P00.03  0003H    Maximum frequency  10.00-400.00                        50.00
"""
BY_TABLES = [
    *("Example Drives EX-1", "EX-1 manual, 3rd edition"),
    *("registers.csv", "41", "-", *PARAMETERS.splitlines(), ".", "42", "y", ""),
    *("command", "1", "2", "5", "6", "7", "41", "y"),
    *("speed_setpoint", "1100H", "number", "1", "2", "3", "4", "43", "output_frequency", "n", "1101H"),
    *("P00.01=2", "", "", "", "P00.03", "", "6", "12", "40", "9600 8N1 1", "39"),
]
BY_HAND = [
    *("Example Drives EX-2", "EX-2 manual", ""),
    *("2000H", "7", "12H", "22h", "0x1", "", "2002H=2", "7", "y"),
    *("2001H", "7", "0.01 %", "P01.00", "0100H", "8", "0.1 Hz", "5 400", "8"),
    *("2100H", "9", "bits", "15=1", "1-0=1", "1-0=2", "1-0=0"),
    *("2103H", "9", "0.1 Hz", "n", "", "", "", "", "all", "16", "1", "10", ""),
]


def asked(folder: Path, answers: list[str], *words: str, options: tuple[str, ...] = ()) -> Result:
    line = [*options, "profiles", "new", str(folder), *(words or ("--ask",))]
    text = "".join(f"{answer}\n" for answer in answers)
    done = CliRunner().invoke(cli, line, prog_name="drivebus", input=text, env={"DRIVEBUS_PORT": None})
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exc_info
    return done


@pytest.fixture
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "registers.csv").write_text(REGISTERS, encoding="utf-8")
    return tmp_path / "ex"


def test_tables_and_words_become_a_profile(there: Path) -> None:
    done = asked(there, BY_TABLES)
    assert done.exit_code == 0, done.output
    assert "is sound: 6 registers, 2 parameters, 0 faults." in done.stdout
    profile = drivebus.Profile.load(there)
    assert profile.title == "Example Drives EX-1"
    assert profile.commands() == {"run_forward": 1, "run_reverse": 2, "stop": 5, "coast": 6, "reset_fault": 7}
    assert [(each.code, each.value) for each in profile.control()] == [("P00.01", 2)]
    assert profile.serial() is not None
    assert profile.requests().source == "EX-1 manual, 3rd edition, p. 40"
    rows = {name: profile.describe(name) for name in ("command", "speed_setpoint", "P00.01", "output_current")}
    assert {name: (row.address, row.unit, row.scale) for name, row in rows.items()} == {
        "command": (0x1000, "", 1),
        "speed_setpoint": (0x1001, "Hz", 100),
        "P00.01": (0x0001, "", 1),
        "output_current": (0x1201, "A", 10),
    }
    assert rows["P00.01"].source == "EX-1 manual, 3rd edition, p. 42"


def test_what_no_table_has_is_asked_for(there: Path) -> None:
    done = asked(there, BY_HAND)
    assert done.exit_code == 0, done.output
    profile = drivebus.Profile.load(there)
    assert profile.commands() == {"run_forward": 0x12, "run_reverse": 0x22, "stop": 1, "reset_fault": 2}
    assert profile.command("reset_fault") == (0x2002, 2)
    assert profile.functions == [3, 16]
    text = (there / "profile.toml").read_text(encoding="utf-8")
    assert '{ name = "bits_1_0", bits = [1, 0] }' in text
    assert "counts = 10000" in text
    row = drivebus.Profile.load(there).describe("P01.00")
    assert (row.address, row.unit, row.scale) == (0x0100, "Hz", 10)


@NO_PTY
@pytest.mark.parametrize("answers", [BY_TABLES, BY_HAND], ids=["by tables", "by hand"])
def test_a_motor_turns_by_it_and_stops(there: Path, answers: list[str]) -> None:
    """A simulated drive that does what the profile says, from the tables to a turning motor."""
    assert asked(there, answers).exit_code == 0
    with Simulator({1: there}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
        drive = bus.drive(1, profile=there)
        if drive.profile.control():
            drive.prepare_control(store=True)
        else:
            drive.write({"P01.00": 50.0}, store=True)
        drive.run(10.0)
        drive.wait_for_speed(10.0)
        assert line.drive(1).frequency == pytest.approx(10.0, abs=0.1)
        drive.stop()
        drive.wait_until_stopped()
        assert line.drive(1).state == "stopped"


@pytest.mark.parametrize(
    ("place", "wrong", "said"),
    [
        (2, "nowhere.csv", "nowhere.csv: No such file"),
        (3, "1000", "1000H, or 1000 as 0x03E8"),
        (3, "spindle", '"spindle" is no name of the tables and no address'),
        (5, "0012", "write 18, 12H or 0x12"),
        (6, "12h", "12h is run forward already"),
        (9, "2000H=1", "1 is stop already"),
        (5, "70000", "no word from 0 to 65535"),
        (9, "here=5", '"here" is no name'),
        (12, "30005", "which is an input register"),
        (14, "0.03 Hz", "such as 0.01 Hz"),
        (14, "0.0003 %", "no 1 to 65535 counts"),
        (12, "2000H", "2000H is the register of another answer"),
        (21, "2001H", "2001H is the register of another answer"),
        (15, "P/1", '"P/1" is no code of a parameter'),
        (18, "0.1 %", '"0.1 %" is no 1, 0.1, 0.01'),
        (19, "400 10", "no lowest and highest value"),
        (24, "17=1", "a word has the bits 0 to 15"),
        (24, "1=2", "does not fit"),
        (24, "running", "is no bit and what it is"),
        (33, "P00.01", "no parameter and value"),
        (36, "P9", '"p9" is none of P01.00'),
        (37, "3", "is neither 6, 16"),
        (38, "0", "is not in the range"),
        (40, "9600 7E1 1", "no speed, format and unit"),
        (40, "9600 8N1 248", "no speed, format and unit"),
    ],
)
def test_a_wrong_answer_is_named_and_asked_again(there: Path, place: int, wrong: str, said: str) -> None:
    """As what was meant follows, the profile is the same."""
    done = asked(there, [*BY_HAND[:place], wrong, *BY_HAND[place:]])
    assert done.exit_code == 0, done.output
    assert said in " ".join(done.stderr.split())
    other = there.with_name("other") / "ex"
    other.parent.mkdir()
    assert asked(other, BY_HAND).exit_code == 0
    assert (there / "profile.toml").read_bytes() == (other / "profile.toml").read_bytes()


def test_where_the_input_ends_nothing_is_written(there: Path) -> None:
    for count in range(len(BY_TABLES) - 1):
        done = asked(there, BY_TABLES[:count])
        assert (done.exit_code, there.exists()) == (2, False), done.output
        assert "Nothing was written" in done.stderr


@pytest.mark.parametrize(
    "words",
    [
        ("--ask", "--like", "gd350"),
        ("--ask", "--overlay", "gd350"),
        ("--ask", "--table", "registers.csv"),
        ("--ask", "--table", "nowhere.csv", "--source", "p. 1"),
    ],
)
def test_what_cannot_be_asked(there: Path, words: tuple[str, ...]) -> None:
    done = asked(there, BY_TABLES, *words)
    assert (done.exit_code, there.exists()) == (2, False)


def test_files_that_are_there_are_told_before_any_question(there: Path) -> None:
    there.mkdir()
    (there / "faults.csv").write_text("mine", encoding="utf-8")
    done = asked(there, BY_TABLES)
    assert (done.exit_code, "Maker and series" in done.stderr) == (2, False)
    assert (there / "faults.csv").read_text(encoding="utf-8") == "mine"


ANSWERS = st.sampled_from(
    [*dict.fromkeys(BY_TABLES + BY_HAND), "", "0", "65535", "-", "n", "P00.01", "0=0", '"', "é\t#"]
)


@given(
    st.sampled_from([BY_TABLES, BY_HAND]), st.lists(st.tuples(st.integers(0, 40), ANSWERS, st.booleans()), max_size=6)
)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_answered_what_is_written_is_sound(
    there: Path, meant: list[str], slips: list[tuple[int, str, bool]]
) -> None:
    """Answers in the wrong place, or one too many; then Enter for what is asked after them."""
    folder = there.with_name("made")
    for file in folder.glob("*"):
        file.unlink()
    answers = [*meant, *[""] * 40]
    for place, slip, is_added in slips:
        answers[place : place + (not is_added)] = [slip]
    done = asked(folder, answers)
    if done.exit_code == 0:
        assert drivebus.Profile.check(folder) == []
    else:
        assert (done.exit_code, [*folder.glob("*")]) == (2, []), done.output


@NO_PTY
def test_it_asks_on_a_terminal_and_nowhere_else(there: Path) -> None:
    import pty

    words = [sys.executable, "-m", "drivebus", "profiles", "new"]
    done = subprocess.run([*words, "plain"], stdin=subprocess.DEVNULL, capture_output=True, timeout=60, check=True)
    assert b"Fill them in" in done.stdout
    leader, follower = pty.openpty()
    with subprocess.Popen([*words, "asked"], stdin=follower, stdout=follower, stderr=follower) as program:
        os.close(follower)
        os.write(leader, "".join(f"{answer}\n" for answer in BY_TABLES).encode())
        said = b""
        while b"Try it on a simulated drive" not in said:
            said += os.read(leader, 1000)
        assert program.wait(60) == 0
    os.close(leader)
    assert drivebus.Profile.load(there.with_name("asked")).commands()["stop"] == 5


def test_what_a_manual_prints_is_taken_as_it_is_printed(there: Path) -> None:
    """Codes with a letter and a dash, numbers of registers, a whole that is a parameter, bits as digits."""
    table = """\
Code  Register  Name               Range                                              Factory
C-02  40771     Command source     0: panel, 1: terminals, 3: serial                  0
C-03  40772     Speed source       0: panel, 4: serial                                0
C-10  40779     Maximum frequency  20.0-200.0 Hz (0.1 Hz)                             60.0
C-21  40790     Deceleration time  0.1-600.0 s (0.1 s)                                5.0
"""
    answers = [
        *("Norvik NV7", "NV7 manual, 4th edition", "-", *table.splitlines(), ".", "90", ""),
        *("40513", "89", "0041H", "0042H", "0040H", "0080H", "40515=00A5H", "89", "y"),
        *("40514", "89", "20000 = C-10", "89"),
        *("40545", "89", "bits", "7=1", "3-2=01", "3-2=10", "3-2=00"),
        *("40546", "89", "0.1 Hz", "n", "40549", "89"),
        *("C-02=3", "speed_source=4", "", "C-21", "C-10", "", "", "", "6", "4", "88", "19200 8E1 7", "88"),
    ]
    done = asked(there, answers)
    assert done.exit_code == 0, done.output
    assert "Parameters: C-02 at 0302H, C-03 at 0303H, C-10 at 030AH, C-21 at 0315H." in done.stderr
    profile = drivebus.Profile.load(there)
    assert [(each.code, each.value) for each in profile.control()] == [("C-02", 3), ("C-03", 4)]
    row = profile.describe("C-10")
    assert (row.unit, row.scale, row.low, row.high, row.access) == ("Hz", 10, 20.0, 200.0, "stop")
    with Simulator({7: there}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
        drive = bus.drive(7, profile=there)
        drive.prepare_control(store=True)
        drive.write({"C-10": 60.0}, store=True)
        drive.run(12.5)
        # 20000 are 60 Hz.
        assert line.drive(7).writes()[-1][1:] == (0x0200, 0x0041)
        assert bus.read(7, 0x0201, 1) == [4167]
        drive.stop()


PRINTED = """\
Register  Acc  Meaning                 Unit / bits
40101     R/W  Control word            bit 0 run
                                       bit 1 direction (1 counter-clockwise)
                                       bit 2 release; bit 7 fault reset
40102     R/W  Speed reference         0.1 Hz, 0 ... 3-05
40111     R    Status word             bit 1 running, bit 2 counter-clockwise,
                                       bit 3 fault
40112     R    Output frequency        0.1 Hz
40113     R    Output current          0.01 A
40114     R    Motor torque            0.1 %, signed
40116     R    Active fault            0 none, else see page 11
"""
SETTINGS = """\
No.   Register  Name                    Range            Ex works  Change
1-01  41101    Command source          0 keypad         1         stopped
                                       1 terminals
                                       2 bus
1-02  41102    Reference source        0 potentiometer  0         stopped
                                       1 analogue input
                                       3 bus
3-01  41301    Acceleration time       0.1 ... 600.0 s  5.0       any time
3-02  41302    Deceleration time       0.1 ... 600.0 s  5.0       any time
               (from 3-05 to 0 Hz)
3-05  41305    Maximum frequency       10.0 ... 400.0 Hz 60.0     stopped
7-01  41701    Bus supervision         0.0 ... 60.0 s   0.0       any time
7-02  41702    Reaction to silence     0 none 1 stop    1         any time
                                       2 trip
"""
LIST_OF_FAULTS = """\
1 E.OC  overcurrent          5 E.OH  heat sink too hot
2 E.OU  overvoltage          9 E.bUS bus silent longer than 7-01
"""
AS_PRINTED = [
    *("Corvan CV-2", "CV-2 supplement", "-", *PRINTED.splitlines(), ".", "6"),
    *("-", *SETTINGS.splitlines(), ".", "8", "y", ""),
    *("control_word", "bit 0 and bit 2", "bits 0, 1, 2", "bit 2", "0", "bits 2 7", "y"),
    *("speed_reference", "status_word", "bits", "3=1", "1=1,2=0", "1=1,2=1", "1=0"),
    *(
        "output_frequency",
        "n",
        "active_fault",
        "1-01=2",
        "1-02=3",
        "",
        "3-02",
        "3-05",
        "7-01",
        "7-02",
        "1",
        "",
        "2",
        "9",
    ),
    *("-", *LIST_OF_FAULTS.splitlines(), ".", "11", "6, 16", "16", "4", "19200 8N1 5", "4"),
]
"""A manual whose tables are pasted as it prints them: lines that go on, values without signs, a gap of one blank."""


def test_a_table_is_pasted_as_it_is_printed(there: Path) -> None:
    done = asked(there, AS_PRINTED)
    assert done.exit_code == 0, done.output
    assert "is sound: 7 registers, 7 parameters, 4 faults." in done.stdout
    profile = drivebus.Profile.load(there)
    assert profile.commands() == {"run_forward": 5, "run_reverse": 7, "stop": 4, "coast": 0, "reset_fault": 0x84}
    assert profile.functions == [3, 6, 16]
    speed = profile.describe("speed_reference")
    assert (speed.address, speed.unit, speed.scale, speed.high_from) == (101, "Hz", 10, "3-05")
    torque = profile.describe("motor_torque")
    assert (torque.unit, torque.scale, torque.signed) == ("%", 10, True)
    source = profile.describe("1-01")
    assert (dict(source.choices), source.access, source.default) == ({0: "keypad", 1: "terminals", 2: "bus"}, "stop", 1)
    ramp = profile.describe("3-02")
    assert (ramp.address, ramp.unit, ramp.scale, ramp.high, ramp.access, ramp.default) == (
        1301,
        "s",
        10,
        600.0,
        "run",
        5.0,
    )
    assert dict(profile.describe("7-02").choices) == {0: "none", 1: "stop", 2: "trip"}
    assert profile.describe("3-05").default == 60.0
    text = (there / "profile.toml").read_text(encoding="utf-8")
    assert '[ramp]\ndeceleration = "3-02"\nstart = "3-05"' in text
    assert '[watchdog]\ntimeout = "7-01"\naction = "7-02"\nstop = 1\ntrip = 2\nfault = 9' in text
    assert [(profile.fault(code).mnemonic, profile.fault(code).label) for code in (1, 5, 9)] == [
        ("E.OC", "overcurrent"),
        ("E.OH", "heat sink too hot"),
        ("E.bUS", "bus silent longer than 7-01"),
    ]
    with Simulator({5: there}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
        drive = bus.drive(5, profile=there)
        drive.prepare_control(store=True)
        drive.run(12.5)
        drive.wait_for_speed()
        # Both words in one request.
        assert [each[1:] for each in line.drive(5).writes()[-2:]] == [(100, 5), (101, 125)]
        assert bus.read(5, 101, 1) == [125]
        drive.run(8.0, reverse=True)
        drive.wait_for_speed()
        assert line.drive(5).state == "reverse"
        assert line.drive(5).frequency == pytest.approx(-8.0, abs=0.1)
        drive.stop()
        drive.wait_until_stopped()


def test_an_answer_is_taken_back(there: Path) -> None:
    """At each question: what was answered before it is answered once more, and the profile is the same."""

    def made(name: str, answers: list[str]) -> tuple[str, dict[str, bytes]]:
        folder = there.with_name(name) / "ex"
        folder.parent.mkdir()
        done = asked(folder, answers)
        assert done.exit_code == 0, done.output
        return done.stderr, {file.name: file.read_bytes() for file in folder.iterdir()}

    _, plain = made("plain", AS_PRINTED)
    said, same = made("first", ["back", *AS_PRINTED])
    assert ("this is the first question" in said, same) == (True, plain)
    begun = 0
    for place, before in enumerate(AS_PRINTED[:-1]):
        if before == "-":
            begun = place + 1
        elif begun and before != ".":
            continue  # a line of what is pasted
        elif not begun:
            begun = place
        answers = [*AS_PRINTED[: place + 1], "back", *AS_PRINTED[begun:]]
        if before != "-":
            assert made(f"ex{place}", answers)[1] == plain, before
            begun = 0


@pytest.mark.parametrize(
    ("question", "wrong", "said"),
    [
        ("bit 2", "bit 16", "a word has the bits 0 to 15"),
        ("6, 16", "6, 5", 'is neither 6, 16 nor "6, 16"'),
    ],
)
def test_what_the_table_says_otherwise_is_no_answer(there: Path, question: str, wrong: str, said: str) -> None:
    place = AS_PRINTED.index(question)
    done = asked(there, [*AS_PRINTED[:place], wrong, *AS_PRINTED[place:]])
    assert done.exit_code == 0, done.output
    assert said in " ".join(done.stderr.split())


def test_a_value_that_the_table_has_not_is_asked_for_once_more(there: Path) -> None:
    place = AS_PRINTED.index("1-01=2")
    done = asked(there, [*AS_PRINTED[:place], "1-01=7", "n", *AS_PRINTED[place:]])
    assert (done.exit_code, "The table has 0 keypad, 1 terminals, 2 bus." in done.stderr) == (0, True), done.output
    other = there.with_name("other")
    assert asked(other, [*AS_PRINTED[:place], "1-01=7", "y", *AS_PRINTED[place + 1 :]]).exit_code == 0
    assert [(each.code, each.value) for each in drivebus.Profile.load(other).control()] == [("1-01", 7), ("1-02", 3)]


IN_BARS = """\
| Addr. | R/W | Description      | Content                     |
|-------|-----|------------------|-----------------------------|
| 3000H | W   | Command          | 0021H forward, 0022H        |
|       |     |                  | reverse, 0010H stop, 0080H  |
|       |     |                  | reset                       |
| 3001H | R/W | Setpoint         | 0.01 % of F1.04             |
| 3100H | R   | State            | 0 standstill, 1 forward, 2  |
|       |     |                  | reverse, 7 fault            |
| 3101H | R   | Fault number     |                             |
| 3102H | R   | Output frequency | 0.01 Hz                     |
"""
IN_GAPS = """\
Code   Addr.  Function           Setting range                 Fact.
F1.01  0101H  Command source     0: keypad                     0
                                 1: terminals
                                 3: serial
F1.04  0104H  Maximum frequency  20.0 to 120.0 Hz              50.0
F4.20  0414H  Serial time-out    0.0 to 60.0 s, 0.0 is off     0.0
"""
BY_WORDS = [
    *("Ostrom OV3", "OV3 manual", "-", *IN_BARS.splitlines(), ".", "63"),
    *("-", *IN_GAPS.splitlines(), ".", "62", "y", ""),
    *("Command", "0021H", "0022H", "0010H", "", "0080H", "y"),
    *("Setpoint", "10000 = F1.04", "63", "State", "number", "1", "2", "0", "7"),
    *("Output frequency", "n", "Fault number", "F1.01=serial", "", "", "F4.20", "", "30", "F4.20"),
    *("", "6", "8", "61", "9600 8-N-1 3", "61"),
]


def test_what_a_table_has_beside_a_register_is_held_against_the_answers(there: Path) -> None:
    done = asked(there, BY_WORDS)
    assert done.exit_code == 0, done.output
    profile = drivebus.Profile.load(there)
    assert profile.commands() == {"run_forward": 0x21, "run_reverse": 0x22, "stop": 0x10, "reset_fault": 0x80}
    assert [(each.code, each.value) for each in profile.control()] == [("F1.01", 3)]
    row = profile.describe("F4.20")
    assert (row.unit, row.scale, row.low, row.high, row.default) == ("s", 10, 0.0, 60.0, 0.0)
    serial = profile.serial()
    assert serial is not None
    assert (serial.baud_rate, serial.format, serial.unit) == (9600, "8N1", 3)
    slips = {"0021H": "21", "10000 = F1.04": "0.01 Hz"}
    for meant, slip in slips.items():
        place = BY_WORDS.index(meant)
        again = there.with_name(f"slip{place}")
        done = asked(again, [*BY_WORDS[:place], slip, "n", *BY_WORDS[place:]])
        assert (done.exit_code, f"Is it {slip} all the same?" in done.stderr) == (0, True), done.output
        assert drivebus.Profile.load(again).commands() == profile.commands()
        assert (again / "profile.toml").read_text(encoding="utf-8").split("\n", 8)[8] == (
            there / "profile.toml"
        ).read_text(encoding="utf-8").split("\n", 8)[8]
    # Who means it says so.
    place = BY_WORDS.index("0021H")
    other = there.with_name("other")
    assert asked(other, [*BY_WORDS[:place], "33", *BY_WORDS[place + 1 :]]).exit_code == 0
    assert drivebus.Profile.load(other).commands() == profile.commands()
    willed = there.with_name("willed")
    after = BY_WORDS.index("0080H") + 1
    own = [*BY_WORDS[:place], "21", "y", *BY_WORDS[place + 1 : after], "64", *BY_WORDS[after:]]
    assert asked(willed, own).exit_code == 0
    assert drivebus.Profile.load(willed).commands()["run_forward"] == 21


WHOLE = """\
Addr.  Description        Unit  Modif.
3000H  Command                  W
3010H  DC bus voltage     V     R
3011H  Heat sink          °C    R
"""


@pytest.mark.parametrize(("said", "scale"), [("y", 1), ("n", 1), ("", 1)])
def test_a_unit_without_a_step_is_asked_for(there: Path, said: str, scale: int) -> None:
    start = ["Arden A1", "A1 manual", "-", *WHOLE.splitlines(), ".", "3", said, ""]
    done = asked(there, [*start, "Command", "1", "", "0", "", "", "3", "y", *[""] * 20])
    assert done.exit_code == 0, done.output
    question = "No step is printed of dc_bus_voltage in V, heat_sink in °C. Is one count of each 1?"
    assert question in " ".join(done.stderr.split())
    row = drivebus.Profile.load(there).describe("dc_bus_voltage")
    assert (row.unit, row.scale, row.access) == ("V" if said == "y" else "raw", scale, "ro")


def test_a_range_that_is_answered_takes_nothing_else_out_of_the_note(there: Path) -> None:
    table = "Code  Addr.  Name    Unit   Range       Change\nP1.00  0100H  Source  codes  see page 9  stopped"
    start = ["Arden A1", "A1 manual", "-", *table.splitlines(), ".", "3", ""]
    done = asked(there, [*start, *[""] * 5, "P1.00=2", "0 3", *[""] * 20])
    assert done.exit_code == 0, done.output
    row = drivebus.Profile.load(there).describe("P1.00")
    assert (row.low, row.high, row.note) == (0.0, 3.0, "the table has 'codes' as its unit")


def test_enter_where_an_answer_is_needed_says_so(there: Path) -> None:
    place = BY_HAND.index("5 400")
    done = asked(there, [*BY_HAND[:place], "", *BY_HAND[place:]])
    assert (done.exit_code, "this is needed" in done.stderr) == (0, True), done.output


def test_a_parameter_is_named_by_its_label(there: Path) -> None:
    place = BY_TABLES.index("P00.01=2")
    answers = [*BY_TABLES[:place], "command source=2", *BY_TABLES[place + 1 :]]
    assert asked(there, answers).exit_code == 0
    assert [(each.code, each.value) for each in drivebus.Profile.load(there).control()] == [("P00.01", 2)]


HALDEN = """\
Register  Name              Meaning                           Unit
40201     Drive command     Bit 0: start                      -
                            Bit 1: direction, 1 is backward
                            Bit 2: enable
40202     Frequency target  0 to A.012                        0.1 Hz
40203     Acknowledge       write 1                           -
30201     Status            Bit 0: ready                      -
                            Bit 4: motor turns
                            Bit 5: backward
                            Bit 7: tripped
30202     Actual frequency                                    0.1 Hz
30204     DC link                                             V
30205     Shaft power       signed                            0.1 kW
30206     Trip number       see 6
"""
HALDEN_SETTINGS = """\
Id.    Register  Name                Range                Ex works  Edit
A.001  40501     Control place       0 keys 1 terminals   0         stop
                                     2 Modbus
A.011  40511     Ramp down           0.5 ... 120.0 s      5.0       always
A.012  40512     Upper frequency     25.0 ... 300.0 Hz    50.0      stop
A.030  40530     Modbus time-out     0.0 ... 30.0 s       0.0       always
A.031  40531     At time-out         0 trip 14 1 ramp     0         always
                                     2 coast
"""
HALDEN_TRIPS = """\
6 Trips
 3  OI   overcurrent            9  OT   drive too hot
 5  OV   DC link too high      14  MB   Modbus time-out
"""
ASKED_OF_HALDEN = [
    *("Halden HX20", "HX20-MB-EN 2.1", "-", *HALDEN.splitlines(), ".", "7", "y"),
    *("-", *HALDEN_SETTINGS.splitlines(), ".", "10", "y", ""),
    *("drive_command", "bits 0, 2", "bits 0, 1, 2", "bit 2", "0", "acknowledge=1", "y"),
    *("frequency_target", "30201", "bits", "7=1", "4=1, 5=0", "4=1, 5=1", "4=0"),
    *("actual_frequency", "n", "trip_number", "A.001=2", "", "A.011", "A.012", "A.030", "A.031", "1", "2", "0", "14"),
    *("-", *HALDEN_TRIPS.splitlines(), ".", "12", "6", "12", "5", "19200 8E1 11", "5"),
]


def test_what_a_manual_calls_bits_and_trips_is_kept(there: Path) -> None:
    done = asked(there, ASKED_OF_HALDEN)
    assert done.exit_code == 0, done.output
    assert "drivebus sim --units 11=" in done.stdout
    assert "Faults: 3 OI overcurrent, 9 OT drive too hot, 5 OV DC link too high, 14 MB Modbus time-out." in done.stderr
    profile = drivebus.Profile.load(there)
    assert profile.command("reset_fault") == (202, 1)
    assert [each.code for each in profile.faults()] == [3, 5, 9, 14]
    target = profile.describe("frequency_target")
    assert (target.low, target.high_from) == (0.0, "A.012")
    power = profile.describe("shaft_power")
    assert (power.unit, power.scale, power.signed) == ("kW", 10, True)
    assert {*(profile.describe("status").bits or {})} == {"tripped", "motor_turns", "backward", "ready"}
    assert profile.watchdog is not None
    assert (profile.watchdog.actions, profile.watchdog.fault) == ({"stop": 1, "coast": 2, "trip": 0}, 14)
    with Simulator({11: there}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
        drive = bus.drive(11, profile=there)
        drive.prepare_control(store=True)
        with pytest.raises(drivebus.NotAllowed, match="0 to 50 Hz"):
            drive.run(60.0)
        drive.run(12.5)
        assert drive.status().ready is True
        assert 500 < drive.read("dc_link") < 600
        for action, state, shown in ((0, "fault", 14), (1, "stopped", 0), (2, "stopped", 0)):
            drive.write({"A.030": 3.0, "A.031": action}, store=True)
            drive.run(12.5)
            drive.wait_for_speed()
            line.advance(9.0)
            assert (line.drive(11).state, line.drive(11).fault) == (state, shown), action
            if shown:
                drive.reset_fault()


@pytest.mark.parametrize(
    ("before", "wrong", "said"),
    [
        ("4=1, 5=0", "7=1, 4=1", "fault is told by 7=1, and so forward would never be"),
        ("4=1, 5=1", "4=1, 5=0, 0=1", "forward is told by 4=1, 5=0, and so reverse would never be"),
        ("4=0", "4=1", "a motor that runs forward shows that too (4=1, 5=0)"),
        ("1", "9", "the table has 0 trip 14, 1 ramp, 2 coast"),
        ("bits 0, 2", "?", "write 18, 12H or 0x12, or bits 0, 2"),
    ],
)
def test_a_state_that_would_never_be_shown_is_no_answer(there: Path, before: str, wrong: str, said: str) -> None:
    place = len(ASKED_OF_HALDEN) - 1 - ASKED_OF_HALDEN[::-1].index(before)
    done = asked(there, [*ASKED_OF_HALDEN[:place], wrong, *ASKED_OF_HALDEN[place:]])
    assert done.exit_code == 0, done.output
    assert said in " ".join(done.stderr.split())
    assert drivebus.Profile.load(there).commands()["run_forward"] == 5


@pytest.mark.parametrize(
    ("before", "wrong", "said"),
    [
        ("A.001=2", "A.001=1", "A.001 = 1 is terminals, by its table. Is it what obeys the bus all the same?"),
        ("1", "2", "A.031 = 2 is coast, by its table. Is it what makes it stop all the same?"),
    ],
)
def test_a_value_that_the_table_calls_otherwise_is_asked_for_once_more(
    there: Path, before: str, wrong: str, said: str
) -> None:
    place = len(ASKED_OF_HALDEN) - 1 - ASKED_OF_HALDEN[::-1].index(before)
    done = asked(there, [*ASKED_OF_HALDEN[:place], wrong, "n", *ASKED_OF_HALDEN[place:]])
    assert (done.exit_code, said in " ".join(done.stderr.split())) == (0, True), done.output


def test_no_page_is_taken_by_enter(there: Path) -> None:
    pages = {"39", "40", "41", "42", "43"}
    slips = [slip for answer in BY_TABLES for slip in ([""] if answer in pages else []) + [answer]]
    done = asked(there, slips)
    assert (done.exit_code, done.stderr.count("this is needed")) == (0, 6), done.output
    other = there.with_name("other") / "ex"
    other.parent.mkdir()
    assert asked(other, BY_TABLES).exit_code == 0
    assert (there / "profile.toml").read_bytes() == (other / "profile.toml").read_bytes()


def test_the_page_before_is_taken_where_that_is_said(there: Path) -> None:
    """The question shows which it is; the first one has none before it."""
    assert AS_PRINTED[-4:] == ["16", "4", "19200 8N1 5", "4"]
    done = asked(there, [*AS_PRINTED[:-1], "same"])
    assert (done.exit_code, "Its page (same: 4)" in done.stderr) == (0, True), done.output
    serial = drivebus.Profile.load(there).serial()
    assert serial is not None
    assert serial.source == "CV-2 supplement, p. 4"
    place = AS_PRINTED.index("6")
    done = asked(there.with_name("other"), [*AS_PRINTED[:place], "same", *AS_PRINTED[place:]])
    assert (done.exit_code, '"same" is the page before, and there is none' in done.stderr) == (0, True), done.output


@pytest.mark.parametrize(
    ("answers", "word", "place", "source"),
    [
        # Each word is printed in the row of the register: as bits, as hexadecimal words, as numbers.
        (AS_PRINTED, "", "commands", "CV-2 supplement, p. 6"),
        (AS_PRINTED, "", "state", "CV-2 supplement, p. 6"),
        (BY_WORDS, "", "commands", "OV3 manual, p. 63"),
        (BY_WORDS, "", "state", "OV3 manual, p. 63"),
        # One is not: its page is asked.
        (AS_PRINTED, "bits 2 7", "commands", "CV-2 supplement, p. 77"),
        (BY_WORDS, "0080H", "commands", "OV3 manual, p. 77"),
    ],
)
def test_words_that_a_table_prints_are_on_its_page(
    there: Path, answers: list[str], word: str, place: str, source: str
) -> None:
    if word:
        at = answers.index(word)
        other = ["bits 2 9"] if word.startswith("bit") else ["0081H", "y"]
        answers = [*answers[:at], *other, "77", *answers[at + 1 :]]
    done = asked(there, answers)
    assert done.exit_code == 0, done.output
    text = (there / "profile.toml").read_text(encoding="utf-8")
    rules = next(part for part in text.split("\n\n") if part.startswith(f"[{place}]"))
    assert f'source = "{source}"' in rules


UNITLESS = """\
Address,Name,R/W
1000H,Command,W
1001H,Frequency command,R/W
1002H,Highest frequency,R/W
1100H,Operation status,R
1101H,Fault number,R
1102H,Status of digital inputs,R
1200H,Output frequency,R
1201H,Output current,R
1202H,Reference frequency,R
"""
SILENT = """\
Code    Address  Name               Range                Change
P00.03  0003H    Maximum frequency  10.00-400.00 Hz      stop
P00.11  000BH    Acceleration time  0.1-600.0 s          run
P00.12  000CH    Deceleration time  0.1-600.0 s          run
P05.01  0501H    Torque limit       0.0-200.0 %          stop
P05.02  0502H    Bus time-out       0.1-60.0 s           stop
"""
UNDER_WRONG_NAMES = [
    *("Vestby V1", "V1 manual", "-", *UNITLESS.splitlines(), ".", "41", "-", *SILENT.splitlines(), ".", "42", "y", ""),
    *("1000H", "1", "2", "5", "", "7", "43", "y"),
    *("1001H", "0.01 Hz", "1100H", "number", "1", "2", "3", "4", "43"),
    *("1200H", "0.01 Hz", "n", "1101H", "", "P00.12", "P00.03", "P05.02", "", "", "", "6", "1", ""),
]


@pytest.mark.parametrize(
    ("meant", "wrong", "said"),
    [
        ("1000H", "1001H", 'The table calls 1001H "Frequency command". Is it the register that takes run'),
        ("1000H", "operation_status", 'The table calls 1100H "Operation status"'),
        ("7", "1201H=1", 'The table calls 1201H "Output current". Is it the register that resets a fault'),
        ("7", "1101H=1", 'The table calls 1101H "Fault number"'),
        ("1001H", "1200H", 'The table calls 1200H "Output frequency". Is it the register that takes the speed'),
        ("1001H", "1002H", 'The table calls 1002H "Highest frequency"'),
        ("1100H", "1102H", 'The table calls 1102H "Status of digital inputs"'),
        ("1100H", "1101H", 'The table calls 1101H "Fault number"'),
        ("1200H", "1201H", 'The table calls 1201H "Output current". Is it the register that tells the out'),
        ("1200H", "1202H", 'The table calls 1202H "Reference frequency"'),
        ("1101H", "1201H", 'The table calls 1201H "Output current"'),
        ("P00.12", "P00.11", 'The table calls 000BH "Acceleration time". Is it the parameter with the'),
        ("P00.12", "P00.03", "P00.03 is in Hz, by its table. Is it the parameter with the time"),
        ("P00.03", "P05.01", "P05.01 is in %, by its table. Is it the parameter with the frequency"),
        ("P05.02", "P00.12", 'The table calls 000CH "Deceleration time". Is it the parameter with the time'),
    ],
)
def test_what_the_table_calls_otherwise_is_insisted_on(there: Path, meant: str, wrong: str, said: str) -> None:
    place = UNDER_WRONG_NAMES.index(meant)
    done = asked(there, [*UNDER_WRONG_NAMES[:place], wrong, "", *UNDER_WRONG_NAMES[place:]])
    assert done.exit_code == 0, done.output
    assert said in " ".join(done.stderr.split())
    other = there.with_name("other") / "ex"
    other.parent.mkdir()
    plain = asked(other, UNDER_WRONG_NAMES)
    assert (plain.exit_code, "all the same" in plain.stderr) == (0, False), plain.output
    assert (there / "profile.toml").read_bytes() == (other / "profile.toml").read_bytes()


def test_a_unit_that_the_table_has_wrong_is_left_to_the_note(there: Path) -> None:
    """A misprint in a table: who means the row says so, and says what one count is."""
    (there.parent / "registers.csv").write_text(REGISTERS.replace("frequency,0.01Hz,R\n", "frequency,0.1A,R\n"))
    place = BY_TABLES.index("output_frequency") + 1
    done = asked(there, [*BY_TABLES[:place], "y", "0.01 Hz", *BY_TABLES[place:]])
    assert (done.exit_code, "output_frequency is in A, by its table. Is it" in done.stderr) == (0, True), done.output
    row = drivebus.Profile.load(there).describe("output_frequency")
    assert (row.unit, row.scale, row.note) == ("Hz", 100, "the table has 'A' as its unit")


def test_makers_names_for_the_same_thing_are_taken() -> None:
    """The rows of the known families, each under the role that it has there."""
    kinds = {"state": STATE, "frequency": FREQUENCY, "fault": FAULT, "setpoints.frequency": SETPOINT}
    asked_for = set()
    for family in drivebus.profiles():
        profile = drivebus.Profile.builtin(family)
        for name, role in kinds.items():
            row = profile.role(name)
            if row is not None:
                label = profile.describe(row).label
                if against(TableRow(1, 0, "holding", row, label), role.kind, ()):
                    asked_for.add(label)
    # Of a drive with a protocol of its own the frequency tells the state; of two the state has the fault in it.
    assert asked_for == {"Output frequency", "What the drive does, and the number of its fault"}
