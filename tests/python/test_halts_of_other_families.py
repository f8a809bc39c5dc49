"""No halt of a family starts, reverses or sets anything in a drive of another: every pair, by the drives' own logs.

`matrix` says what a case is and who judges; here it is told, as programs and people tell it. `make test` runs a sample
of all cases, `make matrix` all of them, in some minutes.
"""

from __future__ import annotations

import asyncio
import os
from collections import Counter
from contextlib import suppress
from typing import Any
from unittest.mock import patch

import pytest
from click.testing import CliRunner

import drivebus
import drivebus.aio
from drivebus import Bus, DrivebusError, Profile, Simulator
from drivebus.cli import cli
from drivebus.site import forget, remember

from .matrix import FAMILIES, WAYS, Case, Judge, Machine, cases, own_halts, sample, set_going

NO_SETPOINT = ("chf100a", "saj8000m")
"""No document prints where they take one."""

PORT = "/dev/matrix"
"""What the command line opens; the simulated line stands behind it."""

COMMANDS = {
    "stop": ["stop"],
    "coast": ["coast"],
    "reset_fault": ["reset", "--yes"],
    "stop_all": ["stop", "--all"],
    "jog block": ["jog", "--yes", "--force"],
}


def by_python(simulator: Simulator, case: Case, judge: Judge) -> str:
    with Bus(simulator) as bus:
        if case.known == "identified":
            with suppress(DrivebusError):
                bus.identify(1)
        drive = bus.drive(1, case.named, unverified=True, trust_profile=case.known == "trusted")
        if case.known == "identified":
            with suppress(DrivebusError):
                drive.contradiction()
        try:
            if case.is_block:
                block = drive.jogging if case.halt == "jog block" else drive.running
                with block(force=True, confirm=0.0):
                    judge.begin()
            else:
                (bus.stop_all if case.halt == "stop_all" else getattr(drive, case.halt))()
        except DrivebusError as error:
            return f"{type(error).__name__}: {error}"
    return ""


async def by_asyncio(simulator: Simulator, case: Case, judge: Judge) -> str:
    async with drivebus.aio.Bus(simulator) as bus:
        if case.known == "identified":
            with suppress(DrivebusError):
                await bus.identify(1)
        drive = await bus.drive(1, case.named, unverified=True, trust_profile=case.known == "trusted")
        if case.known == "identified":
            with suppress(DrivebusError):
                await drive.contradiction()
        try:
            if case.is_block:
                block = drive.jogging if case.halt == "jog block" else drive.running
                async with block(force=True, confirm=0.0):
                    judge.begin()
            else:
                await (bus.stop_all if case.halt == "stop_all" else getattr(drive, case.halt))()
        except DrivebusError as error:
            return f"{type(error).__name__}: {error}"
    return ""


def by_command_line(simulator: Simulator, case: Case) -> str:
    def opened(_: object, **settings: Any) -> Bus:
        return Bus(simulator, **settings)

    options = ["--port", PORT, "--unverified"]
    if case.known in ("named", "trusted"):
        options += ["--profile", case.named]
    if case.known == "trusted":
        options += ["--trust-profile"]
    if case.known == "remembered" or case.halt == "stop_all":
        # `stop --all` knows no unit that is neither in drivebus.toml nor remembered.
        remember(PORT, 1, case.named)
    with patch.object(drivebus, "Bus", opened):
        done = CliRunner().invoke(cli, [*options, *COMMANDS[case.halt]])
    forget(PORT, 1)
    assert done.exception is None or isinstance(done.exception, SystemExit), (case, done.exception)
    return "" if done.exit_code == 0 else f"exit code {done.exit_code}: {done.output}"


def told(simulator: Simulator, case: Case) -> tuple[Judge, list[str]]:
    """The judge of *case*, which was told, and whatever was wrong."""
    judge = Judge(simulator, case)
    if case.by == "python":
        failure = by_python(simulator, case, judge)
    elif case.by == "asyncio":
        failure = asyncio.run(by_asyncio(simulator, case, judge))
    else:
        failure = by_command_line(simulator, case)
    return judge, list(judge.verdict(failure))


@pytest.mark.parametrize("by", WAYS)
@pytest.mark.parametrize("family", FAMILIES)
def test_no_halt_starts_reverses_or_sets_anything(family: str, by: str) -> None:
    tried: Counter[str] = Counter()
    wrong: list[str] = []
    with Machine(family) as machine:
        for case in sample(family, by):
            wrong += told(machine.put(case.before), case)[1]
            tried[case.motion] += 1
    assert {*tried} == {case.motion for case in cases(family, by)}
    assert not wrong, f"{len(wrong)} are wrong, of {sum(tried.values())} cases:\n" + "\n".join(wrong[:20])


def test_the_sample_has_every_pair_and_every_kind_of_case() -> None:
    run = [case for family in FAMILIES for by in WAYS for case in sample(family, by)]
    every = [case for family in FAMILIES for by in WAYS for case in cases(family, by)]
    assert {case[:2] for case in run} == {case[:2] for case in every}
    assert {case[2:] for case in run} == {case[2:] for case in every}


@pytest.mark.parametrize("by", ["python", "asyncio"])
def test_blocks_do_begin_by_another_name(by: str) -> None:
    """Most are refused. Of the others the matrix judges the end, and so there must be some; each pair is tried here."""
    begun: Counter[str] = Counter()
    wrong: list[str] = []
    for family in FAMILIES:
        with Machine(family) as machine:
            for case in cases(family, by):
                if case[2:] == ("block", by, "trusted", "at rest") and case.named != family:
                    judge, said = told(machine.put(case.before), case)
                    begun[family] += judge.has_begun
                    wrong += said
    assert begun.total() >= 50, begun
    assert not wrong, "\n".join(wrong)


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
            assert first[1] in (0x05, 0x06, 0x10), first.hex()
