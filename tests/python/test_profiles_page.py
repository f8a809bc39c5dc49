"""docs/profiles.md: what it tells one to write and type is written and typed here, in its order, and holds."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli

DOCS = Path(__file__).resolve().parent.parent.parent / "docs"
PAGE = (DOCS / "profiles.md").read_text(encoding="utf-8")
FORMAT = (DOCS / "reference/profile-format.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def section(title: str) -> str:
    """The text below the heading *title*."""
    _, heading, rest = PAGE.partition(f"\n## {title}\n")
    assert heading, f"no section {title!r}"
    return rest.partition("\n## ")[0]


def blocks(text: str) -> Iterator[tuple[str, str, str]]:
    """Each block: its language, what it holds, and the file that the paragraph before it names."""
    for match in BLOCK.finditer(text):
        paragraph = text[: match.start()].rstrip().rpartition("\n\n")[2]
        file = re.match(r"`([\w-]+/[\w.]+)`", paragraph)
        yield match[1], match[2], file[1] if file else ""


def type_in(line: str) -> Result:
    """A command line of the page, in the present folder."""
    program, *words = shlex.split(line)
    assert program == "drivebus"
    result = CliRunner().invoke(cli, words, prog_name="drivebus", env={"DRIVEBUS_PORT": None})
    assert "Traceback" not in result.output
    return result


def follow(text: str, folder: Path) -> list[Result]:
    """Writes the files and types the commands of *text*, and compares what is printed where the page shows it."""
    typed = []
    for language, body, file in blocks(text):
        if file:
            (folder / file).write_text(body, encoding="utf-8")
        if language != "console":
            continue
        for entry in re.split(r"^\$ ", body, flags=re.MULTILINE)[1:]:
            command, _, printed = entry.partition("\n")
            result = type_in(command)
            assert result.exit_code == 0, f"{command}: {result.output}"
            if printed:
                assert result.stdout == printed, command
            typed.append(result)
    return typed


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_from_a_manual_page_to_a_profile(folder: Path) -> None:
    *_, shown, described, searched, faults = follow(section("From a manual page to a profile"), folder)
    # What the made-up manual says.
    assert "1000H" in shown.stdout
    assert "coast" in shown.stdout
    for said in ("P00.11", "000BH", "0.0", "3600.0", "10.0"):
        assert said in described.stdout
    assert "output_current" in searched.stdout
    assert "Clean the heat sink" in faults.stdout
    profile = drivebus.Profile.load("ex1")
    assert profile.encode("set_frequency", 12.34) == 1234
    assert profile.command("stop") == (0x1000, 5)
    assert profile.address("P00.11", store=False) == 0x800B
    assert profile.state(3) == "stopped"


def test_what_the_profile_says_can_be_tried_without_the_drive(folder: Path) -> None:
    text = section("From a manual page to a profile")
    assert "drivebus sim --units 1=./ex1" in text
    follow(text, folder)
    with (
        drivebus.Simulator({1: "./ex1"}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        drive = bus.drive(1, profile="./ex1")
        drive.write("acceleration_time_1", 2.0)
        drive.prepare_control()
        drive.run(hz=25.0)
        begun, _, _ = next(write for write in reversed(simulator.drive(1).writes()) if write[1:] == (0x1000, 1))
        simulator.advance(begun + 0.5 - simulator.now())
        # From 0 to 50 Hz it would be 2 s.
        assert simulator.drive(1).frequency == pytest.approx(12.5)
        simulator.advance(1.0)
        assert (drive.state(), drive.read("running_frequency")) == ("forward", 25.0)


def test_what_the_check_says_of_two_slips(folder: Path) -> None:
    text = section("From a manual page to a profile")
    follow(text, folder)
    for file, find, put in (("registers.csv", "A,10,no", "A,3,no"), ("parameters.csv", "10.0,run", "10.0,stp")):
        path = folder / "ex1" / file
        path.write_text(path.read_text(encoding="utf-8").replace(find, put), encoding="utf-8")
    result = type_in("drivebus profiles check ex1")
    assert result.exit_code == 2
    [shown] = [body for language, body, _ in blocks(text) if language == "text" and ", line " in body]
    assert result.stdout == shown


def test_a_drive_one_knows_more_about(folder: Path) -> None:
    before, *_, checked, after = follow(section("A drive you know more about"), folder)
    assert "assumed" in before.stdout
    assert "is sound" in checked.stdout
    assert "1B0AH" in after.stdout
    shipped, overlaid = drivebus.Profile.builtin("vfd500"), drivebus.Profile.load("my-vfd500")
    assert shipped.state_reason() is not None
    assert overlaid.state_reason() is None
    assert overlaid.describe(overlaid.role("state") or "").code == "r27.10"
    assert overlaid.fields("status_word_1", 0b1000)["fault"] != overlaid.fields("status_word_1", 0)["fault"]
    assert (overlaid.family, overlaid.name) == ("vfd500", "my-vfd500")


def test_a_drive_much_like_another(folder: Path) -> None:
    [(_, extension, _)] = blocks(section("A drive much like another"))
    (folder / "ex2").mkdir()
    head = 'name = "ex2"\ntitle = "EX-2"\nversion = 1\nsource = "EX-2 manual"\ndrop = ["P00.15"]\n'
    (folder / "ex2/profile.toml").write_text(head + extension, encoding="utf-8")
    profile = drivebus.Profile.load("ex2")
    assert profile.describe("P00.01").evidence == "verified"
    assert profile.describe("P00.03").evidence == "unverified"
    assert "table of parameters" in profile.describe("P00.03").reason
    with pytest.raises(drivebus.NotAllowed):
        profile.describe("P00.15")


def test_the_reference_names_every_key() -> None:
    """Each key of the sound profile with every table, and each column of its tables."""
    reference = FORMAT.partition("\n## The format\n")[2]
    assert reference
    ex9 = Path(__file__).resolve().parent.parent / "vectors/profiles/ex9"
    for key in re.findall(r"^\[*([a-z_.]+)\]*(?: =|$)", (ex9 / "profile.toml").read_text("utf-8"), re.MULTILINE):
        last = key.rpartition(".")[2]
        if last not in {"frequency", "speed_unit", "rpm", "status_word"}:
            assert last in re.findall(r"\w+", reference), key
    for table in ("registers", "parameters", "faults"):
        columns = (ex9 / f"{table}.csv").read_text("utf-8").partition("\n")[0].split(",")
        for column in columns:
            assert f"`{column}`" in reference, f"{table}: {column}"
