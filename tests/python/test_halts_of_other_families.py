"""No halt of a family starts, reverses or sets anything in a drive of another: every pair, by the drives' own logs.

`matrix` says what a case is and who judges, `matrix_ways` how it is told. `make test` runs a sample of all cases, `make
matrix` all of them, in some minutes. What is awaited has a file of its own, so that they run side by side.
"""

from __future__ import annotations

import os
from contextlib import suppress

import pytest
from click.testing import CliRunner

from drivebus import Bus, DrivebusError, Profile, Simulator
from drivebus.cli import cli
from drivebus.site import remember

from .matrix import FAMILIES, WAYS, Case, Machine, cases, own_halts, sample, set_going
from .matrix_ways import blocks_begun, told, tried

NO_SETPOINT = ("chf100a", "saj8000m")
"""No document prints where they take one."""


@pytest.mark.parametrize("by", ["python", "command line"])
@pytest.mark.parametrize("family", FAMILIES)
def test_no_halt_starts_reverses_or_sets_anything(family: str, by: str) -> None:
    tried(family, by)


def test_the_sample_has_every_pair_and_every_kind_of_case() -> None:
    run = [case for family in FAMILIES for by in WAYS for case in sample(family, by)]
    every = [case for family in FAMILIES for by in WAYS for case in cases(family, by)]
    assert {case[:2] for case in run} == {case[:2] for case in every}
    assert {case[2:] for case in run} == {case[2:] for case in every}


def test_blocks_do_begin_by_another_name() -> None:
    """Most are refused. Of the others the matrix judges the end, and so there must be some; each pair is tried here."""
    assert blocks_begun("python").total() >= 50


@pytest.mark.parametrize("named", ["gd600", "gd3000"])
@pytest.mark.parametrize("family", ["chf100a", "saj8000m"])
def test_one_that_refuses_whatever_it_is_asked_has_not_said_what_it_is(family: str, named: str) -> None:
    """Their stop at 2000H is a setpoint of a CHF100A (its manual, p. 107), and nothing in a SAJ 8000M."""
    with Machine(family) as machine:
        simulator = machine.put("forward")
        _, wrong = told(simulator, Case(family, named, "stop", "python", "identified", "forward"))
        assert (wrong, simulator.drive(1).state) == ([], "stopped")


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize(("kept", "family", "command"), [("gd350", "eds300", "stop"), ("gd350", "ms300", "coast")])
def test_nor_does_a_command_whose_family_was_kept(kept: str, family: str, command: str) -> None:
    """2000H = 5 runs an EDS300 (its manual, p. 46), and 6 runs an MS300 (CP2000 manual, p. 514). On a port, too."""
    with Simulator({1: family}, transport="pty") as simulator:
        remember(simulator.port, 1, kept)
        result = CliRunner().invoke(cli, ["--port", simulator.port, command])
        unit = simulator.drive(1)
        assert unit.state == "stopped", result.output
        assert {(place, word) for _, place, word in unit.writes()} <= own_halts(family)
        assert "was not told" not in result.output


@pytest.mark.parametrize("family", [family for family in FAMILIES if Profile.builtin(family).commands()])
def test_one_that_a_program_ran_is_halted_by_the_first_frame(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as simulator:
        assert set_going(simulator, family, "at rest")
        with Bus(simulator) as bus:
            drive = bus.drive(1, family, unverified=True)
            drive.run(None if family in NO_SETPOINT else 20.0)
            seen = len(simulator.line.trace())
            with suppress(DrivebusError):
                drive.stop()
            first = next(frame for _, who, frame in simulator.line.trace()[seen:] if who == "master")
            by = (0x03,) if drive.profile.requests().protocol == "huanyang" else (0x05, 0x06, 0x10)
            assert first[1] in by, first.hex()
