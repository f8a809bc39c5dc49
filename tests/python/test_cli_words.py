"""What the command line says to who typed something else: what came, what is allowed, what to do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

SIM = "sim://gd350?clock=virtual"


def run(*words: str, port: str | None = SIM) -> Result:
    arguments = [*(["--port", port] if port else []), *words]
    return CliRunner().invoke(cli, arguments, prog_name="drivebus", env={"DRIVEBUS_PORT": None})


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--unit", "abc", "status"], '"abc" is not a unit address; write 1-247, or a list such as 1-31,40'),
        (["--unit", "0", "status"], 'unit "0" is out of range; allowed is 1 to 247'),
        (["--unit", "200-300", "status"], 'units "200-300" are out of range; allowed is 1 to 247'),
        (["--unit", "9-3", "status"], 'units "9-3": the first is above the last; write 3-9'),
        (["--baud", "fast", "status"], '"fast" is not a whole number; allowed is 1 or more'),
        (["monitor", "--count", "0"], "0 is out of range; allowed is 1 or more"),
        (["monitor", "--interval", "often"], '"often" is not a number of seconds'),
        (["monitor", "--interval", "0,5"], '"0,5" is not a number of seconds; write 0.5'),
        (["jog", "--seconds", "99", "--yes"], "99 is out of range; allowed is 0 to 60"),
        (["run", "10,5", "--yes"], '"10,5" is not a number of Hz; write 10.5'),
        (["run", "fast", "--yes"], '"fast" is not a number of Hz'),
        (["run", "-5.5", "--yes"], "`drivebus run 5.5 --reverse` turns the other way"),
        (["run", "5", "--wait", "-5"], "-5 is out of range; allowed is 0 or more"),
        (["run", "--rverse", "5"], "No such option '--rverse'"),
        (["run", "", "--yes"], '"" is not a number of Hz'),
        (["write", "P00.11=1,5"], "write 1.5"),
        (["read", "P00.11=1"], "`drivebus write P00.11=1`"),
        (["read", ""], "an empty text is not a name"),
        (["monitor", " "], "an empty text is not a name"),
        (["write", "=5"], "write NAME=VALUE"),
        (["--profile", "", "status"], '"" is not a profile; give a name (gd350'),
        (["backup", ""], "an empty text is not a path"),
        (["restore", ""], "an empty text is not a path"),
        (["profiles", "new", ""], "an empty text is not a path"),
        (["profiles", "check", ""], "an empty text is not a path"),
        (["raw", "01 03 21 03 00 01 7E 36"], "it is added; give 01 03 21 03 00 01"),
        (["statsu"], "Did you mean 'status'?"),
    ],
)
def test_what_was_typed_what_is_allowed_and_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*words)
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in " ".join(result.stderr.split())
    assert list(tmp_path.iterdir()) == []


def test_who_has_no_drive_is_told_how_to_do_without() -> None:
    for words in (["describe", "ramp"], ["faults", "--all"]):
        result = run(*words, port=None)
        assert (result.exit_code, "--profile NAME" in result.stderr) == (2, True)


def test_a_frame_whose_end_looks_like_its_crc_can_be_forced() -> None:
    """A GD350 refuses it for its length, so it was sent."""
    assert run("raw", "--force", "01 03 21 03 00 01 7E 36").exit_code == 4


def test_no_profile_is_the_folder_one_happens_to_be_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).resolve().parent.parent / "vectors/profiles/ex9")
    assert drivebus.Profile.find(".").name == "ex9"
    with pytest.raises(drivebus.NotAllowed, match='"" is not a profile'):
        drivebus.Profile.find("")


@pytest.mark.parametrize("words", [["status"], ["read", "P00.03"], ["monitor", "--count", "1", "P00.03"], ["coast"]])
def test_where_nobody_answers_the_doctor_is_named(words: list[str]) -> None:
    before = [] if words[0] in ("status", "coast") else ["--profile", "gd350"]
    result = run(*before, "--unit", "9", "--format", "8N1", *words)
    assert result.exit_code == 3
    assert result.stderr.splitlines()[-1] == f"What may be wrong: `drivebus doctor '{SIM}' --unit 9 --format 8N1`"


@pytest.mark.parametrize(
    ("family", "options", "said"),
    [
        ("vfd500", [], ["From the factory Veikong VFD500 has other settings: `--baud 9600 --format 8N1 --unit 1`"]),
        ("vfd500", ["--baud", "9600", "--format", "8N1"], []),
        ("gd350", [], []),
    ],
)
def test_who_gets_no_answer_is_told_how_the_factory_sets_the_family(
    family: str, options: list[str], said: list[str]
) -> None:
    with drivebus.Simulator({7: "gd350"}, transport="tcp") as line:
        result = CliRunner().invoke(cli, ["--port", line.port, *options, "--profile", family, "status"])
    assert result.exit_code == 3
    assert [row for row in result.stderr.splitlines() if "factory" in row] == said


def test_what_the_line_has_no_part_in_names_no_doctor() -> None:
    for words in (["decode", "01 03 21 03 00 01 00 00"], ["read", "6300H"], ["read", "nosuch"]):
        assert "doctor" not in run(*words).stderr


def test_a_profile_with_several_mistakes_says_how_to_see_them_all(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    run("profiles", "new", str(folder), port=None)
    assert run("--profile", str(folder), "describe", "example_frequency", port=None).exit_code == 0
    with (folder / "profile.toml").open("a", encoding="utf-8") as file:
        file.write("\n[nonsense]\n")
    (folder / "faults.csv").write_text("one\n", encoding="utf-8")
    result = run("--profile", str(folder), "status")
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == f"All 2: `drivebus profiles check {folder}`"


@pytest.mark.skipif(os.name == "nt", reason="a shell of POSIX closes it")
def test_who_has_no_standard_input_is_not_asked() -> None:
    done = subprocess.run(
        ["sh", "-c", 'exec "$0" "$@" <&-', sys.executable, "-m", "drivebus", "--port", SIM, "reset"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (done.returncode, done.stderr.splitlines()[-1]) == (
        2,
        "Error: without a terminal this needs --yes; nothing was done",
    )


@pytest.mark.parametrize("answer", ["", "n\n", "\n"])
def test_no_answer_is_no(monkeypatch: pytest.MonkeyPatch, answer: str) -> None:
    """The end of the input too, Ctrl-D on a terminal."""
    monkeypatch.setattr("click.testing._NamedTextIOWrapper.isatty", lambda _: True, raising=False)
    result = CliRunner().invoke(cli, ["--port", SIM, "reset"], input=answer)
    assert (result.exit_code, result.stderr.splitlines()[-1]) == (2, "Cancelled. Nothing was written.")


def test_an_interrupt_has_its_own_exit_code(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(drivebus.Drive, "status", interrupted)
    result = run("status")
    assert (result.exit_code, result.output) == (130, "Interrupted.\n")
