"""`drivebus profiles new` with the drive there: each answer is held against what it shows; nothing is written.

The drives are simulated ones that do what a profile of the same answers says.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus import Simulator, tables
from drivebus.cli import cli
from drivebus.cli.drive_beside import WordReader

from .conftest import NO_PTY
from .test_profile_interview import BY_HAND, BY_TABLES, BY_WORDS, REGISTERS, asked


@pytest.fixture
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "registers.csv").write_text(REGISTERS, encoding="utf-8")
    return tmp_path / "ex"


def with_what_is_so(answers: list[str]) -> list[str]:
    """*answers* as they are given beside a drive: that is there, and does what its state shows."""
    place = answers.index("4") + 1 if "4" in answers else answers.index("1-0=0") + 1
    return ["y", *answers[:place], "y", *answers[place:]]


BESIDE = with_what_is_so(BY_TABLES)


def again(line: Simulator, there: Path, answers: list[str]) -> Result:
    """What comes of *answers* beside the drive of *line*; the profile is in the folder `again`."""
    folder = there.with_name("again")
    done = asked(folder, answers, options=("--port", line.port))
    assert not line.drive(1).writes()
    return done


def said(done: Result) -> str:
    return " ".join(done.stderr.split())


def rules(folder: Path) -> list[str]:
    """The rules of a profile, without its name and what tells the drive from others."""
    text = (folder / "profile.toml").read_text(encoding="utf-8").partition("\n[identification")[0].rstrip()
    return [line for line in text.splitlines() if not line.startswith(("#", "name = "))]


def test_a_family_that_is_known_needs_no_profile(there: Path) -> None:
    done = asked(there, ["y", "n"], options=("--port", "sim://gd350?clock=virtual"))
    assert (done.exit_code, there.exists()) == (2, False)
    assert "no profile is needed: --profile gd350" in " ".join(done.stderr.split())


@NO_PTY
def test_each_row_is_read_and_nothing_is_written(there: Path) -> None:
    assert asked(there, BY_TABLES).exit_code == 0
    again = there.with_name("again")
    with Simulator({1: there}, transport="pty") as line:
        done = asked(again, BESIDE, options=("--port", line.port))
        assert done.exit_code == 0, done.output
        assert "output_current" in done.stdout
        assert not line.drive(1).writes()


@NO_PTY
def test_by_what_it_answers_it_is_told_from_others(there: Path) -> None:
    """It is commanded from 0000H on, where an ACS355 has its setpoint at 0001H, too, and what it shows at 0005H."""
    moved = {"0001H": "4001H", "0003H": "4003H", "1000H": "0000H", "1001H": "0001H"}
    moved |= {"1100H": "0005H", "1101H": "0008H", "1200H": "0006H", "1201H": "0007H"}

    def lower(text: str) -> str:
        return re.sub("[01][0-9]{3}H", lambda found: moved[found[0]], text)

    there.with_name("registers.csv").write_text(lower(REGISTERS), encoding="utf-8")
    answers = [lower(answer) for answer in BY_TABLES]
    assert asked(there, answers).exit_code == 0
    again = there.with_name("again")
    with Simulator({1: there}, transport="pty") as line:
        done = asked(again, with_what_is_so(answers), options=("--port", line.port))
        assert (done.exit_code, "so that no other is taken for it" in done.stderr) == (0, True), done.output
        signature = drivebus.Profile.load(again).signature()
        assert signature is not None
        assert signature["answers"] == [0x0005, 0x0006]
        with drivebus.Bus(line.port) as bus:
            for place in signature["refuses"]:
                table, address = tables.split(place)
                with pytest.raises(drivebus.Refused):
                    bus.read(1, address, table=table)
            bus.drive(1, profile=again, unverified=True).write({"speed_setpoint": 5.0})
        words = ["--port", line.port, "profiles", "check", str(there), "--read"]
        checked = CliRunner().invoke(cli, words, prog_name="drivebus")
        assert (checked.exit_code, '\nanswers = ["0x0005", "0x0006"]\n' in checked.stderr) == (0, True)
    taken = []
    for profile in (there, again):
        with Simulator({1: "acs355"}, transport="process", clock="virtual") as line, drivebus.Bus(line) as bus:
            with suppress(drivebus.NotAllowed):
                bus.drive(1, profile=profile, unverified=True).write({"speed_setpoint": 5.0})
            taken.append([word for _, place, word in line.drive(1).writes() if place == 1])
    assert taken == [[500], []]


@NO_PTY
def test_what_the_drive_refuses_is_named_at_once_and_at_last(there: Path) -> None:
    assert asked(there, BY_TABLES).exit_code == 0
    place = BESIDE.index("output_frequency")
    refusal = (
        "unit 1 refuses 1202H (02H, illegal data address): it has nothing to read there, or the address is one off."
    )
    with Simulator({1: there}, transport="pty") as line:
        slip = again(line, there, [*BESIDE[:place], "1202H", "", *BESIDE[place:]])
        assert (slip.exit_code, f"{refusal} Is it 1202H all the same?" in said(slip)) == (0, True), slip.output
        off = [*BESIDE[:place], "1202H", "y", "41", "0.01 Hz", *BESIDE[place + 1 :]]
        meant = asked(there.with_name("meant"), off, options=("--port", line.port))
    assert (meant.exit_code, "unit 1 refuses output_frequency_2" in meant.stderr) == (4, True), meant.output
    assert drivebus.Profile.check(there.with_name("meant")) == []


@NO_PTY
@pytest.mark.parametrize("answers", [BY_TABLES, BY_HAND], ids=["by tables", "by hand"])
def test_what_it_shows_is_said_beside_each_answer(there: Path, answers: list[str]) -> None:
    assert asked(there, answers).exit_code == 0
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, with_what_is_so(answers))
    assert done.exit_code == 0, done.output
    wanted = (
        [
            "speed_setpoint is 50.00 Hz now.",
            "state shows 0003H now: it stands still. Is that so?",
            "output_frequency is 0.00 Hz now.",
            "P00.01 is 0 now: keypad.",
        ]
        if answers is BY_TABLES
        else [
            "P01.00 is 5.0 Hz now.",
            "what_the_motor_does shows 0000H now: it stands still.",
            "output_frequency is 0.0 Hz now",
        ]
    )
    assert [each for each in wanted if each not in said(done)] == []
    assert rules(there.with_name("again")) == rules(there)


@NO_PTY
def test_a_state_that_is_not_so_is_described_anew(there: Path) -> None:
    """The words for a standstill and for the other way are mixed up; Enter is no answer."""
    assert asked(there, BY_TABLES).exit_code == 0
    place = BESIDE.index("number")
    with Simulator({1: there}, transport="pty") as line:
        mixed = again(line, there, [*BESIDE[:place], "number", "1", "3", "2", "4", "", "n", *BESIDE[place:]])
        assert mixed.exit_code == 0, mixed.output
        assert "state shows 0003H now: it runs in reverse. Is that so?" in said(mixed)
        assert '"" is neither y nor n' in said(mixed)
        assert rules(there.with_name("again")) == rules(there)
        other = asked(
            there.with_name("other"),
            [*BESIDE[:place], "number", "1", "2", "7", "4", "n", *BESIDE[place:]],
            options=("--port", line.port),
        )
    assert (other.exit_code, "0003H now, which is none of these. Are they right" in said(other)) == (0, True)
    assert rules(there.with_name("other")) == rules(there)


SCALES = """\
Address,Name,Range,R/W
1000H,Command,,W
1001H,Speed setpoint,0.0-400.0 Hz,R/W
1100H,State,,R
1101H,Fault number,,R
1200H,Output frequency,0.0-400.0 Hz,R
"""


@NO_PTY
def test_a_value_out_of_its_range_is_told_by_its_step(there: Path) -> None:
    """The setpoint is 5000 counts: 50 Hz in hundredths. In tenths it were 500 Hz, and its table ends at 400 Hz."""
    assert asked(there, BY_TABLES).exit_code == 0
    there.with_name("registers.csv").write_text(SCALES, encoding="utf-8")
    answers = [*BESIDE[: BESIDE.index("-")], "n", *BESIDE[BESIDE.index("-") :]]
    place = answers.index("speed_setpoint") + 1
    frequency = answers.index("output_frequency") + 1
    steps = [*answers[:place], "0.1 Hz", "", "0.01 Hz", *answers[place:frequency], "0.01 Hz", *answers[frequency:]]
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, steps)
    assert done.exit_code == 0, done.output
    assert "speed_setpoint is 500.0 Hz now, and its table has 0.0 to 400.0. Is it right all the same?" in said(done)
    assert "speed_setpoint is 50.00 Hz now." in said(done)
    assert drivebus.Profile.load(there.with_name("again")).describe("speed_setpoint").scale == 100


@NO_PTY
def test_a_frequency_that_the_motor_has_not_is_no_output_frequency(there: Path) -> None:
    """Its setpoint is there at rest, too; no table says what is at 1001H."""
    assert asked(there, BY_TABLES).exit_code == 0
    words = REGISTERS.replace("1001H,Speed setpoint", "1001H,Frequency")
    there.with_name("registers.csv").write_text(words, encoding="utf-8")
    answers = ["1001H" if answer == "speed_setpoint" else answer for answer in BESIDE]
    place = answers.index("1001H")
    swapped = [*answers[:place], "1200H", "y", *answers[place + 1 :]]
    place = swapped.index("output_frequency")
    swapped = [*swapped[:place], "frequency", "", "", *swapped[place + 1 :]]
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, swapped)
    assert done.exit_code == 0, done.output
    assert "1001H has 5000 now, and the motor stands still. Is it right all the same?" in said(done)
    assert drivebus.Profile.load(there.with_name("again")).role("frequency") is None


@NO_PTY
def test_a_drive_that_does_not_answer_is_told_once(there: Path) -> None:
    assert asked(there, BY_TABLES).exit_code == 0
    with Simulator({1: there}, transport="pty") as line:
        silent = there.with_name("again")
        done = asked(silent, ["y", *BY_TABLES], options=("--port", line.port, "--unit", "9"))
        assert done.exit_code == 0, done.output
        assert done.stderr.count("no answer within") == 1
    assert rules(silent) == rules(there)


class GoneAfter:
    """A bus whose unit answers so many reads with *word*, and then no more."""

    def __init__(self, reads: int, word: int) -> None:
        self.left, self.word = reads, word

    def read(self, unit: int, address: int, **_how: str) -> list[int]:
        self.left -= 1
        if self.left < 0:
            raise drivebus.NoAnswer(f"unit {unit}, read {address:04X}H: no answer")
        return [self.word]


@pytest.mark.parametrize("reads", range(5))
def test_one_that_stops_answering_is_told_once(reads: int, capsys: pytest.CaptureFixture[str]) -> None:
    """The interview goes on to its end without it."""
    reader = WordReader(GoneAfter(reads, 0), 1, "unit 1")  # type: ignore[arg-type]
    found = [reader.read(place) for place in range(8)]
    assert [word.value for word in found] == [0] * reads + [None] * (8 - reads)
    assert (reader.is_silent, capsys.readouterr().err.count("no answer")) == (True, 1)


@NO_PTY
def test_beside_a_drive_an_answer_is_taken_back_too(there: Path) -> None:
    """At each question; what the drive showed is kept, and what is asked anew is read anew."""
    assert asked(there, BY_TABLES).exit_code == 0
    begins = BESIDE.index("command")
    answers = [each for answer in BESIDE[begins:] for each in (answer, "back", answer)]
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, [*BESIDE[:begins], *answers[:-2]])
    assert done.exit_code == 0, done.output
    assert rules(there.with_name("again")) == rules(there)


@NO_PTY
@pytest.mark.parametrize(
    ("place", "wrong", "told"),
    [
        ("2103H", ["2104H", ""], "unit 1 refuses 2104H (02H, illegal data address)"),
        ("2001H", ["2005H", ""], "unit 1 refuses 2005H"),
        ("2100H", ["2101H", ""], "unit 1 refuses 2101H"),
        ("0100H", ["0101H", "", "P01.00"], "unit 1 refuses 0101H"),
        ("5 400", ["10 400", ""], "P01.00 is 5.0 Hz now, and it is to be from 10 to 400."),
    ],
)
def test_what_no_table_has_is_looked_for_in_the_drive(there: Path, place: str, wrong: list[str], told: str) -> None:
    assert asked(there, BY_HAND).exit_code == 0
    answers = with_what_is_so(BY_HAND)
    at = answers.index(place)
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, [*answers[:at], *wrong, *answers[at:]])
    assert (done.exit_code, told in said(done)) == (0, True), done.output
    assert rules(there.with_name("again")) == rules(there)


COUNTED_FROM_1 = """\
Address,Name,Unit,R/W
1000H,Command,,W
1002H,Speed setpoint,0.01Hz,R/W
1101H,State,,R
1102H,Fault number,,R
1202H,Output current,0.1A,R
1203H,Serial number,,
"""


@NO_PTY
def test_a_table_is_held_against_the_drive_before_any_question_of_it(there: Path) -> None:
    """Its addresses are one too high: it is asked for anew. What it calls readable counts, and nothing else."""
    assert asked(there, BY_TABLES).exit_code == 0
    (there.parent / "off.csv").write_text(COUNTED_FROM_1, encoding="utf-8")
    place = BESIDE.index("registers.csv")
    slip = [*BESIDE[:place], "off.csv", "41", "", *BESIDE[place:]]
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, slip)
    assert done.exit_code == 0, done.output
    told = "unit 1 refuses speed_setpoint at 1002H, fault_number at 1102H, output_current at 1202H"
    assert f"{told}. Is the table right all the same?" in said(done)
    assert "unit 1 refuses serial_number at 1203H." in said(done)
    assert "unit 1 shows speed_setpoint 50.00 Hz, output_frequency 0.00 Hz, output_current 0.0 A." in said(done)
    assert rules(there.with_name("again")) == rules(there)
    assert "speed_setpoint" in drivebus.Profile.load(there.with_name("again")).names()


@NO_PTY
def test_a_value_that_its_table_has_not_speaks_against_the_table(there: Path) -> None:
    assert asked(there, BY_TABLES).exit_code == 0
    place = BESIDE.index("42")
    low = [line.replace("10.00-400.00   ", "10.00-40.00 Hz ") for line in BESIDE]
    low[place + 1 : place + 2] = ["y", ""]
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, [*low[: place + 3], *BESIDE[BESIDE.index("-") :]])
    assert done.exit_code == 0, done.output
    assert "P00.03 is 50.00 Hz now, and its table has 10.00 to 40.00. Is the table right all the same?" in said(done)
    assert rules(there.with_name("again")) == rules(there)


@NO_PTY
def test_a_setpoint_that_is_refused_is_only_written(there: Path) -> None:
    """As many drives have it: then it is no part of what is read."""
    assert asked(there, BY_TABLES).exit_code == 0
    unknown = REGISTERS.replace("1001H,Speed setpoint,0.01Hz,R/W", "1005H,Speed setpoint,0.01Hz,")
    there.with_name("registers.csv").write_text(unknown, encoding="utf-8")
    place = BESIDE.index("speed_setpoint") + 1
    with Simulator({1: there}, transport="pty") as line:
        done = again(line, there, [*BESIDE[:place], "y", *BESIDE[place:]])
    assert (done.exit_code, "unit 1 refuses 1005H" in said(done)) == (0, True), done.output
    profile = drivebus.Profile.load(there.with_name("again"))
    assert (profile.describe("speed_setpoint").access, profile.role("setpoint")) == ("wo", None)


def test_what_is_answered_after_going_back_may_speak_against_what_it_is_a_part_of(there: Path) -> None:
    """The address of a parameter is taken back, and left out: then its code is asked for once more."""
    place = BY_HAND.index("0100H")
    answers = [*BY_HAND[: place + 1], "back", "", *BY_HAND[place - 1 :]]
    done = asked(there, answers)
    assert (done.exit_code, "P01.00 needs the address of a holding register" in done.stderr) == (0, True), done.output
    assert drivebus.Profile.load(there).describe("P01.00").address == 0x0100


def test_a_whole_that_is_no_parameter_is_asked_for_again(there: Path) -> None:
    place = BY_WORDS.index("10000 = F1.04")
    done = asked(there, [*BY_WORDS[:place], "10000 = F/4", *BY_WORDS[place:]])
    assert (done.exit_code, '"F/4" is no code of a parameter' in done.stderr) == (0, True), done.output
