"""`running(…, wait=True)`: the block is left when the motor stands, in both faces."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from typing import Any

import pytest

import drivebus
import drivebus.aio
from drivebus import NoAnswer, NotAllowed, Simulator, Unconfirmed
from drivebus.operations import waiting

CONTROL, FORWARD, STOP = 0x2000, 1, 5

Block = Callable[[Simulator, Callable[[], None], dict[str, Any]], None]
"""Runs a motor at 5 Hz in a block: what happens there, and the keywords of `running`."""


def _blocking(simulator: Simulator, inside: Callable[[], None], keywords: dict[str, Any]) -> None:
    with drivebus.Bus(simulator, timeout=0.1) as bus:
        drive = bus.drive(1)
        drive.prepare_control()
        with drive.running(5.0, **keywords):
            drive.wait_for_speed(timeout=30)
            inside()


def _awaited(simulator: Simulator, inside: Callable[[], None], keywords: dict[str, Any]) -> None:
    async def main() -> None:
        async with drivebus.aio.Bus(simulator, timeout=0.1) as bus:
            drive = await bus.drive(1)
            await drive.prepare_control()
            async with drive.running(5.0, **keywords):
                await drive.wait_for_speed(timeout=30)
                inside()

    asyncio.run(main())


@pytest.fixture(params=[_blocking, _awaited], ids=["blocking", "asyncio"])
def block(request: pytest.FixtureRequest) -> Block:
    made: Block = request.param
    return made


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as simulator:
        yield simulator


def fail() -> None:
    raise ValueError("inside")


def told(simulator: Simulator) -> list[int]:
    """The commands that the drive took."""
    return [value for _, address, value in simulator.drive(1).writes() if address == CONTROL]


def notes(error: BaseException) -> str:
    """What else is said with *error*. Python 3.10 says nothing."""
    return " ".join(getattr(error, "__notes__", ()))


def test_without_it_the_block_is_left_while_the_motor_slows_down(simulator: Simulator, block: Block) -> None:
    block(simulator, lambda: None, {})
    assert simulator.drive(1).frequency > 0.0


def test_the_block_is_left_at_standstill(simulator: Simulator, block: Block) -> None:
    block(simulator, lambda: None, {"wait": True})
    assert (simulator.drive(1).state, simulator.drive(1).frequency) == ("stopped", 0.0)
    assert told(simulator) == [FORWARD, STOP]


def test_one_that_fails_too(simulator: Simulator, block: Block) -> None:
    with pytest.raises(ValueError, match="inside") as failure:
        block(simulator, fail, {"wait": True})
    assert simulator.drive(1).frequency == 0.0
    assert told(simulator) == [FORWARD, STOP]
    assert notes(failure.value) == ""


@pytest.mark.parametrize("ending", [KeyboardInterrupt, SystemExit])
def test_what_ends_the_program_is_not_kept_waiting(
    simulator: Simulator, block: Block, ending: type[BaseException]
) -> None:
    def end() -> None:
        raise ending

    with pytest.raises(ending):
        block(simulator, end, {"wait": True})
    assert told(simulator) == [FORWARD, STOP]
    assert simulator.drive(1).frequency > 0.0


def test_a_motor_that_takes_longer_is_told_of(simulator: Simulator, block: Block) -> None:
    with pytest.raises(
        Unconfirmed, match=r"unit 1: it did not stop within 0.01 s; it is forward, \d\.\d\d of 5\.00 Hz"
    ):
        block(simulator, lambda: None, {"wait": True, "timeout": 0.01})
    assert told(simulator) == [FORWARD, STOP]


def test_a_block_that_fails_raises_that_all_the_same(simulator: Simulator, block: Block) -> None:
    with pytest.raises(ValueError, match="inside") as failure:
        block(simulator, fail, {"wait": True, "timeout": 0.01})
    if hasattr(failure.value, "__notes__"):
        assert "unit 1 was told to stop, but was not seen at rest" in notes(failure.value)
        assert "it did not stop within 0.01 s; it is forward" in notes(failure.value)


def test_a_drive_that_tripped_is_told_of(simulator: Simulator, block: Block) -> None:
    with pytest.raises(Unconfirmed, match="unit 1 tripped before the wait: OL1"):
        block(simulator, lambda: simulator.drive(1).trip("OL1"), {"wait": True})


def test_a_reset_that_the_drive_ignores_says_which_setting_is_wrong() -> None:
    with drivebus.Bus("sim://ms300?clock=virtual") as bus:
        drive = bus.drive(1, "ms300", unverified=True)
        assert bus.simulator is not None
        bus.simulator.drive(1).trip(1)
        told = r"unit 1 did not reset: it does not take commands from the bus \(00-21 is 0, needs 2\)\. .* sent once"
        with pytest.raises(Unconfirmed, match=told):
            drive.reset_fault()


def test_a_line_that_fails_meanwhile_leaves_a_motor_that_was_told_to_stop(
    simulator: Simulator, block: Block, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait = waiting.wait_until_stopped

    def unplugged(*args: Any, **keywords: Any) -> Coroutine[Any, Any, Any]:
        simulator.line.drop_answers(1000)
        return wait(*args, **keywords)

    monkeypatch.setattr(waiting, "wait_until_stopped", unplugged)
    with pytest.raises(NoAnswer) as failure:
        block(simulator, lambda: None, {"wait": True})
    assert told(simulator) == [FORWARD, STOP]
    if hasattr(failure.value, "__notes__"):
        assert notes(failure.value) == "unit 1 was told to stop, but was not seen at rest"


@pytest.mark.parametrize("keywords", [{"wait": 1}, {"wait": True, "timeout": -1.0}, {"wait": True, "timeout": "long"}])
def test_what_is_no_time_is_refused_before_it_starts(
    simulator: Simulator, block: Block, keywords: dict[str, Any]
) -> None:
    with pytest.raises(NotAllowed, match=r"wait|timeout"):
        block(simulator, fail, keywords)
    assert told(simulator) == []


def test_nothing_starts_whose_standstill_could_not_be_seen() -> None:
    with (
        Simulator({1: "gd3000"}, transport="process", clock="virtual") as simulator,
        drivebus.Bus(simulator) as bus,
    ):
        drive = bus.drive(1, "gd3000")
        before = simulator.drive(1).words_written
        with pytest.raises(NotAllowed, match="waiting for the standstill"), drive.running(5.0, wait=True):
            pytest.fail("the block must not be entered")
        assert simulator.drive(1).words_written == before
