"""How a unit is told to halt: by a program that blocks, by one that awaits, and by a person at the command line.

Each way does what a case of the `matrix` says, on a line that is simulated in virtual time, and lets the judge know.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from contextlib import suppress
from typing import Any
from unittest.mock import patch

from click.testing import CliRunner

import drivebus
import drivebus.aio
from drivebus import Bus, DrivebusError, Simulator
from drivebus.cli import cli
from drivebus.site import forget, remember

from .matrix import FAMILIES, Case, Judge, Machine, cases, sample

__all__ = ["blocks_begun", "told", "tried"]

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


def tried(family: str, by: str) -> None:
    """Tries all cases of the sample, and raises where any of them went wrong."""
    motions: Counter[str] = Counter()
    wrong: list[str] = []
    with Machine(family) as machine:
        for case in sample(family, by):
            wrong += told(machine.put(case.before), case)[1]
            motions[case.motion] += 1
    assert {*motions} == {case.motion for case in cases(family, by)}
    assert not wrong, f"{len(wrong)} are wrong, of {sum(motions.values())} cases:\n" + "\n".join(wrong[:20])


def blocks_begun(by: str) -> Counter[str]:
    """How many blocks begin in a unit of each family by the names of others, which are trusted; each end is judged."""
    begun: Counter[str] = Counter()
    wrong: list[str] = []
    for family in FAMILIES:
        with Machine(family) as machine:
            for case in cases(family, by):
                if case[2:] == ("block", by, "trusted", "at rest") and case.named != family:
                    judge, said = told(machine.put(case.before), case)
                    begun[family] += judge.has_begun
                    wrong += said
    assert not wrong, "\n".join(wrong)
    return begun
