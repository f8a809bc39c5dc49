"""The ear of a simulated line: what it is called, who says so, and where there is none."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from click.testing import CliRunner
from tests.python.test_sim_ctl import served, told

import drivebus
from drivebus.cli import cli

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals")


def test_a_simulator_has_no_ear_unless_it_is_asked_for() -> None:
    with drivebus.Simulator({1: "gd350"}, transport="pty") as simulator:
        assert simulator.ear is None


def test_an_ear_hears_what_a_bus_of_this_process_says(tmp_path: Path) -> None:
    link = tmp_path / "ear"
    with drivebus.Simulator({1: "gd350"}, transport="process", ear=link) as simulator:
        assert simulator.ear == str(link.readlink())
        with drivebus.Bus(link, read_only=True) as ear, drivebus.Bus(simulator) as bus:
            bus.read(1, 0x2103)
            heard = next(drivebus.sniff(ear))
        assert (heard.unit, dict(heard.values)) == (1, {"identification_code": 0x01A0})
    assert not link.is_symlink()
    assert simulator.ear is not None, "what it was"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"ear": True, "transport": "process", "clock": "virtual"}, "real time"),
        ({"ear": 1}, "ear 1 is not a path"),
        ({"ear": ""}, "is not a path"),
    ],
)
def test_an_ear_that_cannot_be_is_refused(arguments: dict[str, object], why: str) -> None:
    with pytest.raises(drivebus.NotAllowed, match=why):
        drivebus.Simulator({1: "gd350"}, **arguments)  # type: ignore[arg-type]


def test_a_link_that_is_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "ear").write_text("mine")
    with pytest.raises(drivebus.PortError, match="is there and is not a link"):
        drivebus.Simulator({1: "gd350"}, ear=tmp_path / "ear")
    assert (tmp_path / "ear").read_text() == "mine"


def test_another_window_is_told_where_the_ear_is(tmp_path: Path) -> None:
    with served("--ear", "--transport", "tcp") as simulation:
        assert simulation["ear"] == simulation["ear_leads_to"]
        assert told("status")["ear"] == simulation["ear"]
        with drivebus.Bus(simulation["ear"], read_only=True) as ear, drivebus.Bus(simulation["port"]) as bus:
            bus.read(1, 0x2103)
            assert next(drivebus.sniff(ear)).unit == 1
        shown = CliRunner().invoke(cli, ["sim", "ctl", "status"])
        assert f"ear          {simulation['ear']}" in shown.stdout
    with served("--ear", str(tmp_path / "ear")) as simulation:
        assert simulation["ear"] == str(tmp_path / "ear")
        assert told("status")["ear"] == str(tmp_path / "ear")
    with served() as simulation:
        assert "ear" not in simulation
        assert told("status")["ear"] is None


def test_an_empty_link_is_not_an_ear() -> None:
    done = CliRunner().invoke(cli, ["sim", "--ear", "   "])
    assert (done.exit_code, "an empty text is not a path" in done.stderr) == (2, True)
