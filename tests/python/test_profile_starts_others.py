"""A profile of one's own whose halt is another family's start: `profiles check` warns, with both names."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus.cli import cli
from drivebus.cli.halts_elsewhere import started_by

EX9 = Path(__file__).resolve().parent.parent / "vectors/profiles/ex9"
"""A made-up family that takes its commands at 2000H, by 06H or 10H."""


def run(*words: object) -> Result:
    return CliRunner().invoke(cli, [*map(str, words)], prog_name="drivebus", env={"DRIVEBUS_PORT": None})


def made(folder: Path, *changes: tuple[str, str]) -> Path:
    """The EX-9 with *changes*, and with 1 as what stops it and 5 as what runs it forward."""
    shutil.copytree(EX9, folder)
    text = (folder / "profile.toml").read_text()
    swapped = (("run_forward = 1\n", "run_forward = 5\n"), ("\nstop = 5\n", "\nstop = 1\n"))
    for before, after in (*swapped, *changes):
        assert before in text
        text = text.replace(before, after)
    (folder / "profile.toml").write_text(text)
    return folder


def test_a_stop_that_runs_another_family_is_warned_of_with_both_names(tmp_path: Path) -> None:
    """INVT's manuals print 1 as forward, at 2000H."""
    mine = made(tmp_path / "ex9")
    done = run("profiles", "check", mine)
    assert done.exit_code == 0, done.output
    told = " ".join(done.stderr.split())
    assert "Warning: ex9: stop (1 at 2000H, by 06H) is run_forward of gd350, " in told
    assert "is sound" in done.stdout
    [stop] = [each for each in started_by(drivebus.Profile.load(mine)) if each.halt == "stop"]
    assert (stop.place, stop.code, stop.function, stop.command) == (0x2000, 1, 0x06, "run_forward")
    assert {"gd350", "gd20", "gd3000"} <= {*stop.families}
    # By its manual an MS300 stops on 1, too.
    assert "ms300" not in stop.families


def test_by_a_function_that_the_other_does_not_take_it_starts_nothing(tmp_path: Path) -> None:
    """A GD3000 takes 06H and no 10H."""
    mine = made(tmp_path / "ex9", ("functions = [0x03, 0x06, 0x08, 0x10]", "functions = [0x03, 0x08, 0x10]"))
    told = run("profiles", "check", mine).stderr
    assert "by 10H) is run_forward of gd350" in " ".join(told.split())
    assert "gd3000" not in told


@pytest.mark.parametrize("like", ["a1000", "saj8000m", "vfd500", "wj200"])
def test_whose_halts_start_nobody_is_not_warned_of(tmp_path: Path, like: str) -> None:
    assert run("profiles", "new", tmp_path / "mine", "--like", like).exit_code == 0
    done = run("profiles", "check", tmp_path / "mine")
    assert (done.exit_code, "Warning" in done.stderr) == (0, False), done.output


def test_what_lies_over_a_family_is_not_held_against_it(tmp_path: Path) -> None:
    assert run("profiles", "new", tmp_path / "mine", "--overlay", "ms300").exit_code == 0
    told = " ".join(run("profiles", "check", tmp_path / "mine").stderr.split())
    assert "mine: stop (1 at 2000H, by 06H) is run_forward of gd350" in told
    assert "ms300" not in told
    assert drivebus.Profile.load(tmp_path / "mine").family == "ms300"
