"""The command `drivebus sim`: what it serves, how it spoils it, and what it leaves behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

import drivebus
from drivebus.cli import cli


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C to a whole console")
def test_sim_serves_until_ctrl_c() -> None:
    words = [sys.executable, "-m", "drivebus", "--json", "sim", "--units", "1=gd350,3=gd350"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        port = json.loads(child.stdout.readline())["port"]
        with drivebus.Bus(port) as bus:
            # Another program has to run for an answer.
            assert [found.unit for found in bus.scan(range(1, 5), timeout=0.5)] == [1, 3]
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=100)
    assert child.returncode == 0


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize("end", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_sim_fails_as_it_is_told_to_and_says_by_what_seed(tmp_path: Path, end: str) -> None:
    link = tmp_path / "drive"
    words = [sys.executable, "-m", "drivebus", "sim", "--faults", "0.02", "--fault", "deaf=1", "--seed", "7", "--echo"]
    with subprocess.Popen([*words, "--link", link], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        said = [child.stdout.readline().strip() for _ in range(6)]
        assert said[:4] == [str(link), f"Leads to: {link.readlink()}", "Unit 1: gd350", "Settings: 19200 8E1"]
        assert said[4].startswith("Faults: flip_bit 0.02, ")
        assert "deaf 1" in said[4]
        assert said[5] == "Seed: 7"
        with drivebus.Bus(link, timeout=0.05, retries=0) as bus, pytest.raises(drivebus.NoAnswer):
            bus.read(1, 0x2103)
        child.send_signal(getattr(signal, end))
        child.communicate(timeout=100)
    assert not link.is_symlink()


@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_the_help_shows_how_the_line_is_set_and_that_works() -> None:
    told = " ".join(CliRunner().invoke(cli, ["sim", "--help"], prog_name="drivebus").stdout.split())
    example = told.partition("--baud and --format: `drivebus ")[2].partition("`")[0].split()
    with subprocess.Popen([sys.executable, "-m", "drivebus", *example], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        said = [child.stdout.readline().strip() for _ in range(3)]
        assert said[1:] == ["Unit 1: vfd500", "Settings: 9600 8N1"]
        child.send_signal(signal.SIGINT)
        child.communicate(timeout=100)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--fault", "late"], "write KIND=RATE"),
        (["--fault", "latest=0.1"], "latest"),
        (["--faults", "2"], "2"),
        (["--units", "1=gd350,1=gd350"], "unit 1 is given twice"),
        (["1=gd350,1=gd350"], "unit 1 is given twice"),
        (["vfd500", "--fault", "late"], "write KIND=RATE"),
        (["vfd501"], "No such command 'vfd501'"),
    ],
)
def test_sim_takes_a_family_and_no_other_words(words: list[str], said: str) -> None:
    result = CliRunner().invoke(cli, ["sim", *words])
    assert result.exit_code == 2
    assert said in result.stderr


@pytest.mark.skipif(os.name == "nt", reason="no pty")
def test_a_link_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    link = tmp_path / "nowhere" / "drive"
    refused = CliRunner().invoke(cli, ["sim", "--link", str(link)])
    assert (refused.exit_code, str(link) in refused.stderr) == (5, True)
