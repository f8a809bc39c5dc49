"""No halt of a family starts, reverses or sets anything in a drive of another: every pair, by the drives' own logs.

A unit of one family is named as another, and told to stop, to coast, to end a jog or to reset, at rest and running. The
judge is the simulated drive: every word that it took must be one by which its own family halts. `make test` runs every
seventh case; `DRIVEBUS_MATRIX=all pytest tests/python/test_halts_of_other_families.py` runs them all, in some minutes.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from contextlib import suppress
from typing import NamedTuple

import pytest
from click.testing import CliRunner

import drivebus
import drivebus.aio
from drivebus import Bus, Drive, DrivebusError, Profile, Simulator
from drivebus.cli import cli
from drivebus.site import remember

HALTS = ("stop", "coast", "jog_stop")
COMMANDS = (*HALTS, "reset_fault")
MOTIONS = ("at rest", "forward", "reverse")
STEP = 1 if os.environ.get("DRIVEBUS_MATRIX") == "all" else 7

RECTIFIERS = ("gd600-rectifier", "gd3000-rectifier")
"""They have no motor; INVT's stop word is all that the simulated ones take."""


NO_SETPOINT = ("chf100a", "saj8000m")
"""No document prints where they take one."""


class Case(NamedTuple):
    """One unit, what it is named as, and what it is told."""

    named: str
    command: str
    motion: str
    trusted: bool


def own_halts(family: str) -> set[tuple[int, int]]:
    profile = Profile.builtin(family)
    return {profile.command(name) for name in HALTS if name in profile.commands()}


def cases(family: str) -> Iterator[Case]:
    """What a unit of *family* is tried with: of all cases each seventh, or all."""
    motions = MOTIONS if Profile.builtin(family).commands() else MOTIONS[:1]
    every = (
        Case(named, command, motion, trusted)
        for named in drivebus.profiles()
        for command in COMMANDS
        if command in Profile.builtin(named).commands()
        for motion in motions
        if motion != "reverse" or "run_reverse" in Profile.builtin(family).commands()
        for trusted in (False, True)
    )
    begin = drivebus.profiles().index(family) % STEP
    return (case for number, case in enumerate(every) if number % STEP == begin)


def set_going(simulator: Simulator, family: str, motion: str) -> bool:
    """Has the unit run as its own family, over a bus that is closed again. Whether it does."""
    profile = Profile.builtin(family)
    with Bus(simulator) as bus:
        drive = bus.drive(1, family, unverified=True, trust_profile=True)
        with suppress(DrivebusError):
            drive.prepare_control(store=profile.memory() is None)
        if motion == "at rest":
            return True
        for hz in (30.0, None):
            try:
                drive.run(hz, reverse=motion == "reverse", force=True)
            except DrivebusError:
                continue
            bus.sleep(8.0)
            return simulator.drive(1).state == motion
    return False


def judge(simulator: Simulator, family: str, before: str, eeprom: int, told: str) -> None:
    """What the unit took, and what it does."""
    unit = simulator.drive(1)
    taken = {(place, word) for _, place, word in unit.take_writes()}
    if family not in RECTIFIERS:
        assert taken <= own_halts(family), told
    assert unit.eeprom_writes == eeprom, told
    if before not in ("forward", "reverse"):
        assert unit.state == before, f"it was started; {told}"
    else:
        assert unit.state in (before, "stopped"), f"it was reversed; {told}"


@pytest.mark.parametrize("family", drivebus.profiles())
def test_no_halt_starts_reverses_or_sets_anything(family: str) -> None:
    tried = 0
    for case in cases(family):
        with Simulator({1: family}, transport="process", clock="virtual") as simulator:
            assert set_going(simulator, family, case.motion), f"{family} does not run {case.motion}"
            unit = simulator.drive(1)
            before, eeprom = unit.state, unit.eeprom_writes
            unit.take_writes()
            with Bus(simulator) as bus:
                drive = bus.drive(1, case.named, unverified=True, trust_profile=case.trusted)
                said = "it returned"
                try:
                    getattr(drive, case.command)()
                except DrivebusError as error:
                    said = f"{type(error).__name__}: {error}"
                told = f"a {family} {case}: {said}"
                judge(simulator, family, before, eeprom, told)
                bus.sleep(60.0)
                if said == "it returned" and case.command in ("stop", "coast"):
                    assert (unit.state not in ("forward", "reverse"), unit.frequency) == (True, 0.0), f"proved; {told}"
                elif case.command in ("stop", "coast") and case.motion != "at rest":
                    assert unit.state in ("forward", "reverse"), f"it was halted, and that was not told; {told}"
            tried += 1
    assert tried >= 10 or not Profile.builtin(family).commands()


PAIRS = [
    (named, family)
    for number, (named, family) in enumerate(
        (named, family) for named in drivebus.profiles() for family in drivebus.profiles() if named != family
    )
    if number % (3 * STEP) == 0
]


@pytest.mark.parametrize(("named", "family"), PAIRS)
@pytest.mark.parametrize("motion", MOTIONS[:2])
def test_nor_does_a_stop_of_all_or_one_of_an_event_loop(named: str, family: str, motion: str) -> None:
    async def awaited(simulator: Simulator) -> None:
        async with drivebus.aio.Bus(simulator) as bus:
            drive = await bus.drive(1, named, unverified=True)
            with suppress(DrivebusError):
                await drive.stop()
            with suppress(DrivebusError):
                await bus.stop_all()

    with Simulator({1: family}, transport="process", clock="virtual") as simulator:
        if not Profile.builtin(family).commands() and motion != "at rest":
            return
        assert set_going(simulator, family, motion)
        before, eeprom = simulator.drive(1).state, simulator.drive(1).eeprom_writes
        simulator.drive(1).take_writes()
        with Bus(simulator) as bus:
            bus.drive(1, named, unverified=True)
            with suppress(DrivebusError):
                bus.stop_all()
        asyncio.run(awaited(simulator))
        judge(simulator, family, before, eeprom, f"a {family} named {named}, {motion}")


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize(("kept", "family"), [("gd350", "eds300"), ("gd350", "ms300"), ("gd10", "eds300")])
@pytest.mark.parametrize("command", ["stop", "coast"])
def test_nor_does_a_command_whose_family_was_kept(kept: str, family: str, command: str) -> None:
    """2000H = 5 runs an EDS300 (its manual, p. 46), and 6 runs an MS300 (CP2000 manual, p. 514)."""
    with Simulator({1: family}, transport="pty") as simulator:
        remember(simulator.port, 1, kept)
        result = CliRunner().invoke(cli, ["--port", simulator.port, command])
        unit = simulator.drive(1)
        assert unit.state == "stopped", result.output
        assert {(place, word) for _, place, word in unit.writes()} <= own_halts(family)
        assert "was not told" not in result.output


@pytest.mark.skipif(os.name == "nt", reason="no pty")
@pytest.mark.parametrize(("named", "family"), PAIRS[::3])
@pytest.mark.parametrize("how", [(), ("--trust-profile",)], ids=["named", "trusted"])
def test_nor_does_a_command_that_names_another_family(named: str, family: str, how: tuple[str, ...]) -> None:
    with Simulator({1: family}, transport="pty") as simulator:
        unit = simulator.drive(1)
        before, eeprom = unit.state, unit.eeprom_writes
        options = ["--port", simulator.port, "--profile", named, "--unverified", *how]
        said = [CliRunner().invoke(cli, [*options, command]).output for command in ("stop", "coast")]
        judge(simulator, family, before, eeprom, f"a {family} named {named}: {said}")


@pytest.mark.parametrize(("named", "family"), PAIRS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_nor_does_the_end_of_a_block_that_began_by_another_name(named: str, family: str, motion: str) -> None:
    """Who trusts a wrong name may start what they like. The end of the block is a halt, and nothing else."""
    begins = Profile.builtin(named).commands()
    of_it = Profile.builtin(family).commands()
    if "run" not in begins or not of_it or (motion == "reverse" and "run_reverse" not in of_it):
        return
    with Simulator({1: family}, transport="process", clock="virtual") as simulator:
        assert set_going(simulator, family, motion)
        unit = simulator.drive(1)
        with Bus(simulator) as bus:
            drive = bus.drive(1, named, unverified=True, trust_profile=True)
            began = None
            with suppress(DrivebusError), drive.running(force=True, confirm=0.0):
                began = (unit.state, unit.eeprom_writes)
                unit.take_writes()
            if began is not None:
                judge(simulator, family, *began, f"a {family} named {named}, {motion}")


@pytest.mark.parametrize("family", drivebus.profiles())
def test_one_that_a_program_ran_is_halted_by_the_first_frame(family: str) -> None:
    if not Profile.builtin(family).commands():
        return
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


class TestOneThatChanges:
    """What answers at the address may change under the hand, or be busy when it is asked."""

    @pytest.fixture
    def line(self) -> Iterator[tuple[Simulator, Bus]]:
        with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            bus.drive(1, "gd350").prepare_control()
            bus.drive(1, "gd350").run(20.0)
            yield simulator, bus

    def test_one_that_is_identified_is_told_at_once(self, line: tuple[Simulator, Bus]) -> None:
        simulator, bus = line
        before = len(simulator.line.trace())
        bus.drive(1, "gd350").stop()
        first = next(frame for _, who, frame in simulator.line.trace()[before:] if who == "master")
        assert first == drivebus.rtu.encode_write(1, 0x2000, 5)

    @pytest.mark.parametrize("exception", [*range(0x01, 0x09), 0x09, 0x0A, 0x0B])
    @pytest.mark.parametrize("seconds", [0.02, 0.5, 2.0, 5.0])
    @pytest.mark.parametrize(
        "end", ["stop", "coast", "stop_all", "block", "exception", "jog", "jog block", "trial", "await"]
    )
    def test_a_refusal_that_ends_leaves_no_motor_running(
        self, line: tuple[Simulator, Bus], exception: int, seconds: float, end: str
    ) -> None:
        simulator, bus = line
        drive = bus.drive(1, "gd350")

        def refuse(*_: object) -> None:
            simulator.drive(1).refuse(exception, asked="writes", seconds=seconds)

        async def awaited() -> None:
            async with drivebus.aio.Bus(simulator) as other, (await other.drive(1, "gd350")).running(20.0):
                refuse()

        if end == "block":
            with drive.running(20.0):
                refuse()
        elif end == "exception":
            with suppress(ZeroDivisionError), drive.running(20.0):
                refuse()
                raise ZeroDivisionError
        elif end == "trial":
            # Its setpoint may be refused, too: then it ends early.
            with suppress(DrivebusError):
                drivebus.trial.step(drive, 20.0, 25.0, duration=0.5, max_current=None, told=refuse)
        elif end == "await":
            asyncio.run(awaited())
        elif end.startswith("jog"):
            drive.stop()
            drive.wait_until_stopped(timeout=60)
            if end == "jog":
                drive.jog()
                refuse()
                drive.jog_stop()
            else:
                with drive.jogging():
                    refuse()
        else:
            refuse()
            {"stop": drive.stop, "coast": drive.coast, "stop_all": bus.stop_all}[end]()
        drive.wait_until_stopped(timeout=60)
        assert simulator.drive(1).state == "stopped"

    @pytest.mark.parametrize("lost", [0.3, 0.5, 0.7, 0.85])
    def test_requests_that_are_lost_leave_no_motor_running(self, lost: float) -> None:
        for seed in range(60 if STEP == 1 else 12):
            with (
                Simulator({1: "gd350"}, transport="process", clock="virtual", seed=seed) as simulator,
                Bus(simulator) as bus,
            ):
                drive: Drive = bus.drive(1, "gd350")
                drive.prepare_control()
                # What the line says of the proof is not what is asked here: the motor must be told.
                with suppress(DrivebusError), drive.running(20.0):
                    simulator.line.set_faults(deaf=lost)
                simulator.line.clear()
                bus.sleep(60.0)
                assert simulator.drive(1).state == "stopped", f"seed {seed}"

    def test_a_unit_that_stays_busy_is_told_nothing_that_could_start_it(self) -> None:
        """It says neither what it is nor anything else, for ever: 06H is busy (Modbus V1.1b3, section 7)."""
        with Simulator({1: "eds300"}, transport="process", clock="virtual") as simulator, Bus(simulator) as bus:
            simulator.drive(1).refuse(0x06)
            with pytest.raises(drivebus.DrivebusError, match=r"the motor may still turn"):
                bus.drive(1, "gd350").stop()
            assert simulator.drive(1).writes() == []
            assert simulator.drive(1).state == "stopped"

    def test_a_halt_that_was_refused_says_what_the_refusal_means(self, line: tuple[Simulator, Bus]) -> None:
        """06H of a GD350: it got a damaged frame (GD350 manual, section 9.4.7), which is no decision."""
        simulator, bus = line
        simulator.drive(1).refuse(0x06, asked="writes")
        with pytest.raises(drivebus.Refused, match="not taken") as refused:
            bus.drive(1, "gd350").stop()
        assert (refused.value.code, refused.value.means, refused.value.is_decision) == (0x06, "ask_again", False)
