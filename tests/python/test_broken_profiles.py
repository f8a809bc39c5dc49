"""Broken profiles: `drivebus profiles check` names file and line, and says what stands there and what would be right.

The mistakes and what must be said stand in `tests/vectors/profiles/broken.toml`; those that are no text are made here.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

import drivebus
from drivebus.cli import cli

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

VECTORS = Path(__file__).resolve().parent.parent / "vectors" / "profiles"
FILES = ["profile.toml", "registers.csv", "parameters.csv", "faults.csv"]
CASES: list[dict[str, Any]] = tomllib.loads((VECTORS / "broken.toml").read_text(encoding="utf-8"))["case"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the sound profile."""
    return Path(shutil.copytree(VECTORS / "ex9", tmp_path / "ex9"))


def check(folder: Path, exit_code: int = 2) -> list[dict[str, Any]]:
    """What the command says is wrong."""
    result = CliRunner().invoke(cli, ["--json", "profiles", "check", str(folder)])
    assert result.exit_code == exit_code, result.output
    assert "Traceback" not in result.output
    return [json.loads(line) for line in result.stdout.splitlines()]


def change(path: Path, find: str, put: str) -> str:
    """Replaces *find* by *put* once, and returns the new text."""
    text = path.read_text(encoding="utf-8")
    assert find in text, f"{find!r} is not in {path.name}"
    path.write_text(text.replace(find, put, 1), encoding="utf-8")
    return text.replace(find, put, 1)


def test_there_are_at_least_thirty() -> None:
    assert len({case["what"] for case in CASES}) == len(CASES) >= 30


def test_the_sound_profile_is_sound(folder: Path) -> None:
    assert check(folder, exit_code=0) == []


@pytest.mark.parametrize("case", CASES, ids=lambda case: str(case["what"]).replace(" ", "-"))
def test_a_mistake_is_named(folder: Path, case: dict[str, Any]) -> None:
    text = change(folder / case["file"], case["find"], case["put"])
    place = text.index(case.get("at", case["put"]))
    problems = check(folder)
    assert len(problems) == case.get("count", 1), problems
    found = [problem["line"] for problem in problems if all(said in problem["reason"] for said in case["says"])]
    assert found == [text.count("\n", 0, place) + 1], problems
    assert {Path(problem["file"]) for problem in problems} == {folder / case["file"]}
    first = problems[0]
    with pytest.raises(drivebus.NotAllowed) as error:
        drivebus.Profile.load(folder)
    assert f"{first['file']}, line {first['line']}: {first['reason']}" in str(error.value)


def test_all_mistakes_are_named_at_once(folder: Path) -> None:
    """Several of each file, in the order of files and lines."""
    chosen = {
        "an unknown key",
        "a number where text belongs",
        "a kind of unit that there is not",
        "a scale that is no power of ten",
        "an address in decimal",
        "an access that there is not",
        "a fault number given twice",
        "evidence that is neither yes, no nor assumed",
    }
    everything_is_named(folder, chosen)


def test_what_disagrees_is_named_at_once(folder: Path) -> None:
    """As above, where each file is right by itself."""
    chosen = {
        "a line that no drive has",
        "a memory bit that no parameter leaves free",
        "a command whose code the register does not take",
        "a state told by a bit that there is not",
        "a value that a parameter cannot have",
        "a parameter that is not there",
        "a bound that is no parameter",
        "a variant that there is not",
    }
    everything_is_named(folder, chosen)


def everything_is_named(folder: Path, chosen: set[str]) -> None:
    wanted = [case for case in CASES if case["what"] in chosen]
    assert len(wanted) == len(chosen)
    for case in wanted:
        change(folder / case["file"], case["find"], case["put"])
    problems = check(folder)
    for case in wanted:
        assert any(
            Path(problem["file"]).name == case["file"] and all(said in problem["reason"] for said in case["says"])
            for problem in problems
        ), case["what"]
    assert len(problems) == len(wanted), problems
    places = [(FILES.index(Path(problem["file"]).name), problem["line"]) for problem in problems]
    assert places == sorted(places)


def test_people_are_told_how_many(folder: Path) -> None:
    change(folder / "registers.csv", "Output current,A,10", "Output current,A,3")
    result = CliRunner().invoke(cli, ["profiles", "check", str(folder)])
    assert result.exit_code == 2
    [line] = result.stdout.splitlines()
    assert line.startswith(f"{folder / 'registers.csv'}, line 10: scale ")
    assert "1 problem" in result.stderr


def test_a_mark_before_the_text_and_other_line_ends_are_no_mistake(folder: Path) -> None:
    for file in FILES:
        text = (folder / file).read_text(encoding="utf-8")
        (folder / file).write_bytes(b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode())
    assert check(folder, exit_code=0) == []
    change(folder / "registers.csv", "0x2101,fault_code", "8449,fault_code")
    assert [problem["line"] for problem in check(folder)] == [7]


@pytest.mark.parametrize("file", FILES)
class TestFiles:
    def test_not_utf8(self, folder: Path, file: str) -> None:
        text = (folder / file).read_bytes()
        (folder / file).write_bytes(text.replace(b"\n", b"\n\xff", 3).replace(b"\n\xff", b"\n", 2))
        [problem] = check(folder)
        assert (Path(problem["file"]).name, problem["line"]) == (file, 4)
        assert "UTF-8" in problem["reason"]

    def test_too_big(self, folder: Path, file: str) -> None:
        with (folder / file).open("a", encoding="utf-8") as sink:
            sink.write("\n" * (1 << 20))
        [problem] = check(folder)
        assert Path(problem["file"]).name == file
        assert "1 MiB" in problem["reason"]

    def test_not_there(self, folder: Path, file: str) -> None:
        (folder / file).unlink()
        [problem] = check(folder)
        assert (Path(problem["file"]).name, problem["line"]) == (file, None)

    @pytest.mark.skipif(os.name == "nt", reason="no devices, and links only for administrators")
    @pytest.mark.parametrize("target", ["/dev/zero", "/dev/tty", "the loop", "a pipe"])
    def test_no_file_at_all(self, folder: Path, file: str, target: str) -> None:
        """Nothing of it is read: a device has no end, a pipe waits for a writer."""
        (folder / file).unlink()
        if target == "a pipe":
            os.mkfifo(folder / file)
        else:
            (folder / file).symlink_to(file if target == "the loop" else target)
        [problem] = check(folder)
        assert (Path(problem["file"]).name, problem["line"]) == (file, None)
        assert problem["reason"]


@pytest.mark.parametrize(
    ("file", "row"),
    [
        ("registers.csv", "0x4000,r,x,,1,no,,,,,,ro,yes,,s"),
        ("parameters.csv", "P40.00,,x,,1,no,,,,,,,ro,,yes,,s"),
        ("faults.csv", "{},,x,,,yes,,s"),
    ],
)
def test_limits_of_a_table(folder: Path, file: str, row: str) -> None:
    text = (folder / file).read_text(encoding="utf-8")
    (folder / file).write_text(text.replace("EX-9 manual", "x" * 401, 1), encoding="utf-8")
    [problem] = check(folder)
    assert (Path(problem["file"]).name, problem["line"]) == (file, 2)
    assert '"source"' in problem["reason"]
    assert "400" in problem["reason"]
    many = "".join(f"{row.format(number)}\n" for number in range(100, 10_100))
    (folder / file).write_text(text + many, encoding="utf-8")
    assert any("10000 rows" in problem["reason"] for problem in check(folder))


def test_a_folder_that_is_none(tmp_path: Path) -> None:
    for place in (tmp_path / "nowhere", tmp_path):
        [problem] = check(place)
        assert Path(problem["file"]) == place / "profile.toml"
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert check(tmp_path / "file")


def test_a_rectifier_takes_over_nothing_that_moves_a_motor(tmp_path: Path) -> None:
    def problems(drop: str) -> list[dict[str, Any]]:
        head = f'name = "x"\nkind = "rectifier"\nsource = "x"\ndrop = [{drop}]\n'
        text = f'{head}[extends]\nprofile = "gd350"\nassumption = "x"\n'
        (tmp_path / "profile.toml").write_text(text, encoding="utf-8")
        return drivebus.Profile.check(tmp_path)

    [problem] = problems("")
    assert problem["line"] == 6
    for said in ("run_reverse", "jog_forward", "setpoints.frequency", '"gd350"'):
        assert said in problem["reason"]
    assert problems('"control_command", "set_frequency"') == []
    assert drivebus.Profile.load(tmp_path).commands() == {}


def test_a_chain_of_profiles_ends(tmp_path: Path) -> None:
    """Three folders one over the other are allowed, four are not, and neither is a circle."""

    def write(name: str, over: str) -> Path:
        (tmp_path / name).mkdir(exist_ok=True)
        head = f'name = "{name}"\ntitle = "x"\nversion = 1\nsource = "x"\n'
        (tmp_path / name / "profile.toml").write_text(f'{head}[overlay]\nprofile = "{over}"\n', encoding="utf-8")
        return tmp_path / name

    one = write("one", "gd350")
    two = write("two", "./../one")
    three = write("three", "./../two")
    assert check(three, exit_code=0) == []
    [problem] = check(write("four", "./../three"))
    assert Path(problem["file"]).resolve() == two / "profile.toml"
    assert "3 one over the other" in problem["reason"]
    write("one", "./../two")
    [problem] = check(two)
    assert Path(problem["file"]).resolve() == one / "profile.toml"
    assert (problem["line"], "itself" in problem["reason"]) == (6, True)


@pytest.mark.parametrize(
    ("file", "find", "line"),
    [
        pytest.param("profile.toml", "[serial]", "k{} = 1\n", id="unknown-keys"),
        pytest.param("profile.toml", '"P07.27"]', '"x{}",\n', id="unknown-names"),
        pytest.param("registers.csv", "0x2000,", "0x4000,r{},x,,1,no,,,,,,ro,yes,,s\n", id="one-address"),
    ],
)
def test_thousands_of_mistakes_take_no_longer(folder: Path, file: str, find: str, line: str) -> None:
    """The first hundred are named. Without that limit this takes most of a minute."""
    change(folder / file, find, "".join(line.format(number) for number in range(9_000)) + find)
    assert len(check(folder)) == 100


def test_nothing_in_a_profile_reaches_the_terminal_as_a_command(folder: Path) -> None:
    change(folder / "registers.csv", "0x2101,fault_code", "\x1b]0;title\x07,fault_code")
    result = CliRunner().invoke(cli, ["profiles", "check", str(folder)])
    assert "\\x1b]0;title\\x07" in result.stdout
    assert not {"\x1b", "\x07"} & set(result.stdout + result.stderr)
