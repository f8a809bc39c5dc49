"""A Goodrive200A whose P14.06 moves its commands elsewhere, so that 2000H = 5 is no stop but a speed: it is asked.

GD200A operation manual (INVT, Operation Manual Goodrive200A), pp. 93 and 94: the hundreds digit is 0 for the addresses
of this series, 1 for those in P14.07 (commands, 1000H) and P14.08 (frequency, 2000H), 2 for those of a CHF100A; the
tens digit encrypts, the ones digit leaves writes unanswered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from drivebus import Bus, Drive, NotAllowed, Simulator

from .jobs import asked

MOVES = ("06 2000", "10 2000", "06 2001", "06 2009", "06 200A")


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "gd200a"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    """One that says itself that the bus commands it."""
    with Bus(line) as bus:
        drive = bus.drive(1, "gd200a")
        drive.prepare_control(store=True)
        yield drive


def moving(line: Simulator) -> list[str]:
    return [frame for frame in asked(line) if f"{frame[3:8]}{frame[9:11]}" in MOVES]


def reads(line: Simulator) -> int:
    """Reads of P14.06 alone."""
    return sum(frame.startswith("01 03 0E 06 00 01") for frame in asked(line))


STARTS: list[Callable[[Drive], object]] = [
    lambda drive: drive.run(10.0),
    lambda drive: drive.run(reverse=True),
    lambda drive: drive.jog(),
    lambda drive: drive.special_control(torque_control=True),
    lambda drive: drive.set_virtual_inputs(S1=True),
]


@pytest.mark.parametrize("word", [0x100, 0x200, 0x010, 0x001, 0x211])
@pytest.mark.parametrize("start", STARTS)
def test_nothing_that_moves_it_is_sent(
    line: Simulator, drive: Drive, start: Callable[[Drive], object], word: int
) -> None:
    drive.write("P14.06", word, store=True)
    with pytest.raises(NotAllowed, match=rf"unit 1 has its words elsewhere:\nP14.06 .*: {word}, needs 0"):
        start(drive)
    assert moving(line) == []
    assert line.drive(1).state == "stopped"


def test_it_is_asked_each_time_and_not_set(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    drive.stop(confirm=0)
    before = reads(line)
    assert before
    drive.run(10.0)
    assert reads(line) > before
    drive.stop(confirm=0)
    line.advance(60.0)
    drive.write("P14.06", 0x100, store=True)
    with pytest.raises(NotAllowed, match=r"P14.06 of unit 1 is 256, and must be 0 .*away from a master"):
        drive.prepare_control(store=True)
    assert drive.read("P14.06") == 0x100
    assert [item.code for item in drive.check_control() if not item.ok] == ["P14.06"]


def test_other_families_are_not_asked() -> None:
    with Simulator({1: "gd350"}, transport="process", clock="virtual") as other, Bus(other) as bus:
        drive = bus.drive(1, "gd350")
        drive.prepare_control(store=True, unverified=True)
        drive.run(10.0)
        assert not [frame for frame in asked(other) if frame.startswith("01 03 0E 06")]
