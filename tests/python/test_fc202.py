"""A Danfoss FC 202: the words of an FC 51, a current of two words, and 3-03 that may be in rpm.

VLT AQUA Drive design guide MG.20.N5.22 (easymanua.ls danfoss vlt-aqua 225022), pp. 203 and 209: registers 50000, 50010,
50200 and 3029, one less on the wire where the register is numbered: C34FH, C359H, C417H, and 3-03 at 0BD5H. Bytes are
typed by hand: 10 Hz of 50 Hz are 16384 / 5 = 3276.8 counts, 3277 are 0CCDH.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivebus import Bus, Drive, DrivebusError, NotAllowed, Simulator, State

from .jobs import carry_out_awaited

REFERENCE = "01 06 C3 59 0C CD"
RUN = "01 06 C3 4F 04 7C"
STOP = "01 06 C3 4F 04 3C"
COAST = "01 06 C3 4F 04 34"
RESET = "01 06 C3 4F 04 BC"
READ_3_03 = "01 03 0B D5 00 02"

BOTH = ["fc51", "fc202"]


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "fc202"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "fc202", unverified=True)


def sent(line: Simulator, function: int = 0x06) -> list[str]:
    """The requests of one function, without their CRCs."""
    frames = [data for _, who, data in line.line.trace() if who == "master"]
    return [frame[:-2].hex(" ").upper() for frame in frames if frame[1] == function]


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    return [
        lambda: drive.run(10.0),
        lambda: drive.wait_for_speed(10.0, timeout=30),
        lambda: line.drive(1).trip(4),
        drive.reset_fault,
        lambda: drive.run(10.0),
        drive.coast,
        lambda: line.advance(60.0),
        drive.run,
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=30),
    ]


WHOLE = [REFERENCE, RUN, RESET, REFERENCE, RUN, COAST, RUN, STOP]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert sent(line) == WHOLE
    assert sent(line, 0x10) == []


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "fc202", program)
    assert sent(line) == WHOLE


def test_what_it_measures(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    drive.wait_for_speed(10.0, timeout=30)
    seen = drive.monitor()
    assert (drive.state(), seen["running_frequency"], seen["main_actual_value"]) == (State.FORWARD, 10.0, 20.001)
    assert 0.0 < seen["output_current"] < 10.0
    assert READ_3_03 in sent(line, 0x03)
    assert drive.read("3-03") == 50.0


def test_without_a_word_of_trust_nothing_moves(line: Simulator) -> None:
    """The bits of its control word are those of its sisters."""
    with Bus(line) as bus:
        plain = bus.drive(1, "fc202")
        starts: list[Callable[[], object]] = [lambda: plain.run(10.0), plain.run, plain.stop, plain.coast]
        for start in starts:
            with pytest.raises(NotAllowed, match="unverified=True"):
                start()
        assert plain.state() is State.STOPPED
    assert sent(line) == []


def test_a_highest_reference_in_rpm_is_no_frequency(line: Simulator) -> None:
    """The page's own example: 0016E360H are 1500 rpm (p. 209)."""
    with Bus(line) as bus, pytest.raises(NotAllowed, match="1 Hz to 400 Hz"):
        bus.drive(1, "fc202", unverified=True, variants={"base_frequency": "1500 Hz"})
    assert sent(line) == []


def test_who_says_how_many_hertz_is_believed(line: Simulator) -> None:
    with Bus(line) as bus:
        bus.drive(1, "fc202", unverified=True, variants={"base_frequency": "50 Hz"}).run(10.0)
    assert sent(line) == [REFERENCE, RUN]
    assert READ_3_03 not in sent(line, 0x03)


@pytest.mark.parametrize("family", BOTH)
def test_each_is_known_by_what_it_answers(family: str) -> None:
    with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
        found = bus.identify(1)
    assert (found.certainty, found.candidates) == ("by answers", (family,))


@pytest.mark.parametrize("named", BOTH)
@pytest.mark.parametrize("unit", BOTH)
def test_by_either_name_it_turns_as_told_or_not_at_all(unit: str, named: str) -> None:
    """Commands and reference are the same in both."""
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True)
            try:
                drive.run(10.0)
            except DrivebusError:
                assert line.drive(1).writes() == []
                assert unit != named
                return
            line.advance(30.0)
            assert line.drive(1).frequency == pytest.approx(10.0, abs=0.01)
            drive.stop()
            drive.wait_until_stopped(timeout=30)
        assert line.drive(1).speed == 0.0
