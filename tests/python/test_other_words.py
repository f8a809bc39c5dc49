"""Drives that are set to another control profile of their own, in which the word that stops may start.

What they are set to is read before the first word, beside what they are. The cases are
`tests/vectors/other_words.toml`, which `crates/drivebus/tests/other_words.rs` reads, too.
"""

from __future__ import annotations

import asyncio
import logging
import warnings
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import pytest
import tomli

from drivebus import Bus, Drive, DrivebusWarning, NotAllowed, Simulator, State, aio

from .jobs import asked

CASES: list[dict[str, Any]] = tomli.loads(
    (Path(__file__).parents[1] / "vectors" / "other_words.toml").read_text(encoding="utf-8")
)["case"]

READ_CHCF, READ_58_25 = "01 03 20 D1 00 01", "01 03 16 C0 00 01"
CHCF = 8401


@pytest.fixture(params=CASES, ids=lambda case: f"{case['family']} {case['order']} {case['what'][:40]}")
def case(request: pytest.FixtureRequest) -> dict[str, Any]:
    found: dict[str, Any] = request.param
    return found


@pytest.fixture
def line(case: dict[str, Any]) -> Iterator[Simulator]:
    with Simulator({1: case["family"]}, transport="process", clock="virtual") as line:
        set_up(line, case["set"])
        yield line


def set_up(line: Simulator, settings: list[list[int]]) -> None:
    with Bus(line) as master:
        for address, word in settings:
            master.write(1, address, word)
    line.drive(1).take_writes()


def started(line: Simulator, case: dict[str, Any]) -> None:
    with Bus(line) as master:
        master.write(1, *case["start"])
    line.advance(60.0)
    assert line.drive(1).frequency > 1.0
    line.drive(1).take_writes()


def written(line: Simulator) -> list[list[int]]:
    return [[at, word] for _, at, word in line.drive(1).take_writes()]


def says(case: dict[str, Any]) -> AbstractContextManager[object]:
    if case["sent"]:
        return pytest.warns(DrivebusWarning, match=case["says"])
    return pytest.raises(NotAllowed, match=case["says"])


def ordered(drive: Drive, order: str) -> None:
    {"stop": drive.stop, "coast": drive.coast, "reset": drive.reset_fault}[order]()


def named(bus: Any, case: dict[str, Any]) -> Any:
    return bus.drive(1, case.get("named", case["family"]), unverified=True)


def test_no_halt_starts_a_motor_at_rest(case: dict[str, Any], line: Simulator) -> None:
    if case["order"] == "reset":
        line.drive(1).trip(7)
    with Bus(line) as bus, says(case):
        ordered(named(bus, case), case["order"])
    assert written(line) == case["sent"]
    line.advance(60.0)
    assert line.drive(1).frequency == 0.0


def test_a_motor_that_runs_is_halted(case: dict[str, Any], line: Simulator) -> None:
    if "start" not in case or case["order"] == "reset":
        pytest.skip("nothing starts it, or what is asked does not halt")
    started(line, case)
    with Bus(line) as bus, says(case):
        ordered(named(bus, case), case["order"])
    assert written(line) == case["sent"]
    line.advance(60.0)
    assert line.drive(1).frequency == 0.0


def test_the_same_awaited(case: dict[str, Any], line: Simulator) -> None:
    if case["order"] == "reset":
        line.drive(1).trip(7)

    async def main() -> None:
        async with aio.Bus(line) as bus:
            drive = await named(bus, case)
            await {"stop": drive.stop, "coast": drive.coast, "reset": drive.reset_fault}[case["order"]]()

    with says(case):
        asyncio.run(main())
    assert written(line) == case["sent"]


def test_what_is_written_by_its_address_is_held_back_too(case: dict[str, Any], line: Simulator) -> None:
    """As a start by name is."""
    if "named" in case:
        pytest.skip("another reason holds it back")
    with Bus(line) as bus, pytest.raises(NotAllowed, match=case["says"]):
        named(bus, case).write_words(
            {"atv600": 8501, "atv71": 8501, "atv320": 8501, "acs580": 0}[case["family"]], 1, force=True
        )
    assert written(line) == []


def atv600(mode: int) -> Simulator:
    line = Simulator({1: "atv600"}, transport="process", clock="virtual")
    set_up(line, [[8413, 164], [CHCF, mode]])
    return line


@pytest.mark.parametrize("mode", [1, 2])
def test_where_the_words_are_the_same_it_is_asked_once_and_stopped_as_ever(mode: int) -> None:
    """With 2 the channels are apart, and the bits of CMD are those of CiA 402 as well."""
    with atv600(mode) as line, Bus(line) as bus:
        drive = bus.drive(1, "atv600", unverified=True)
        before = len(asked(line))
        drive.stop()
        assert written(line) == [[8501, 7]]
        drive.stop()
        drive.coast()
        frames = [frame[:-6] for frame in asked(line)[before:]]
        assert frames.count(READ_CHCF) == 1


def test_a_setting_that_this_program_changes_is_asked_anew() -> None:
    with atv600(1) as line, Bus(line) as bus:
        drive = bus.drive(1, "atv600")
        drive.stop()
        drive.write_words(CHCF, 3)
        line.drive(1).take_writes()
        with pytest.warns(DrivebusWarning, match="CHCF"):
            drive.stop()
        assert written(line) == [[8501, 0]]


def test_a_start_that_is_refused_for_it_leaves_nothing_known() -> None:
    """Another master set it meanwhile: a start reads it each time, and the stop behind that start asks again."""
    with atv600(1) as line, Bus(line) as bus:
        drive = bus.drive(1, "atv600")
        drive.stop()
        set_up(line, [[CHCF, 3]])
        with pytest.raises(NotAllowed, match="CHCF"):
            drive.run(10.0)
        with pytest.warns(DrivebusWarning, match="CHCF"):
            drive.stop()
        assert written(line) == [[8501, 0]]


def test_a_start_needs_no_second_look() -> None:
    with atv600(1) as line, Bus(line) as bus:
        drive = bus.drive(1, "atv600")
        before = len(asked(line))
        drive.run(10.0)
        drive.stop()
        assert [frame[:-6] for frame in asked(line)[before:]].count(READ_CHCF) == 1


def test_who_makes_errors_of_warnings_is_halted_all_the_same(caplog: pytest.LogCaptureFixture) -> None:
    with atv600(3) as line, Bus(line) as bus, warnings.catch_warnings(), caplog.at_level(logging.WARNING):
        warnings.simplefilter("error")
        drive = bus.drive(1, "atv600")
        drive.stop()
        assert drive.state() is State.STOPPED
    assert "CHCF of unit 1 (Schneider Altivar 600) is 3 (the I/O profile: bits 0 and 1 run the motor)" in caplog.text
    assert "it was told to stop by 0000H" in caplog.text


def test_several_are_halted_side_by_side() -> None:
    """One of two is set otherwise."""
    with Simulator({1: "atv600", 2: "atv600"}, transport="process", clock="virtual") as line:
        with Bus(line) as master:
            for unit, mode in ((1, 3), (2, 1)):
                master.write(unit, 8413, 164)
                master.write(unit, CHCF, mode)
        for unit in (1, 2):
            line.drive(unit).take_writes()
        with Bus(line) as bus:
            for unit in (1, 2):
                bus.drive(unit, "atv600")
            with pytest.warns(DrivebusWarning, match="CHCF of unit 1 "):
                bus.stop_all()
        assert [[at, word] for _, at, word in line.drive(1).writes()] == [[8501, 0]]
        assert [[at, word] for _, at, word in line.drive(2).writes()] == [[8501, 7]]


def test_nothing_is_said_where_nothing_is_otherwise() -> None:
    with atv600(1) as line, Bus(line) as bus, warnings.catch_warnings():
        warnings.simplefilter("error")
        with nullcontext(bus.drive(1, "atv600", unverified=True)) as drive:
            drive.coast()
        assert written(line) == [[8501, 0]]
