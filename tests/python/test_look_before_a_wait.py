"""Who starts a motor and waits for its speed knows before the start whether that can be seen.

A family whose commands are verified and whose state is not would run first, and say afterwards that it cannot look.
"""

from __future__ import annotations

import pytest
from click.testing import CliRunner, Result

import drivebus
from drivebus import Bus, DrivebusError, Simulator
from drivebus.cli.app import cli

FAMILIES = [name for name in drivebus.profiles() if "rectifier" not in name and name != "chv100"]
"""Who has commands."""


@pytest.mark.parametrize("unverified", [False, True])
@pytest.mark.parametrize("family", FAMILIES)
def test_the_check_says_what_the_wait_would(family: str, unverified: bool) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(1, family)
        for hz in (None, 10.0):
            asked = bus.now()
            refused: type[DrivebusError] | None = None
            try:
                drive.check_speed(hz, unverified=unverified)
            except DrivebusError as error:
                refused = type(error)
            assert bus.now() == asked
            waited: type[DrivebusError] | None = None
            try:
                drive.wait_for_speed(hz, timeout=0.0, unverified=unverified)
            except DrivebusError as error:
                waited = type(error)
            # A wait that asked came to its own end, which the check does not foresee.
            assert refused == (waited if bus.now() == asked else None)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_run_that_could_not_look_is_refused_before_the_start(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line:
        opened = Bus
        monkeypatch.setattr(drivebus, "Bus", lambda _port, **_: opened(line))
        with opened(line) as bus:
            blind = False
            try:
                bus.drive(1, family).check_speed(10.0)
            except DrivebusError:
                blind = True
        line.drive(1).take_writes()
        done = run("--profile", family, "run", "10", "--yes", "--wait", "5")
        assert not blind or (done.exit_code in (2, 4) and not line.drive(1).take_writes()), done.output


def run(*words: str) -> Result:
    return CliRunner().invoke(cli, ["--port", "line", *words])
