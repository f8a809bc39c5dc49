"""A Hitachi SJ200 from a program, and beside a WJ200, whose coils are one lower and whose direction is the other way.

SJ200 manual, p. B-12 (manualsonline sj200_series, p. 226): 0A 05 00 01 FF 00 DC 81 runs unit 10. P. B-19 (manualslib
68018, p. 233): coil 0002h is 0 for reverse and 1 for forward. Bytes are typed by hand; judged is the drive's own log.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

import drivebus
from drivebus import Bus, Drive, DrivebusError, Profile, Simulator, State

from .jobs import carry_out_awaited
from .on_the_wire import written
from .starts import STARTS

RUN = bytes.fromhex("0A 05 00 01 FF 00 DC 81")

SETTINGS: dict[str, dict[int, int]] = {
    # What makes each obey the bus, as its keypad would have it.
    "sj200": {},
    "wj200": {},
    "h100": {0x0001: 2, 0x0002: 2},
    "acs355": {0x03E8: 10, 0x044E: 8},
    "a1000": {},
    "gd350": {0x0001: 2, 0x0002: 0, 0x0006: 8},
    "gd600": {0x0001: 2, 0x0006: 8},
    "optidrive-e3": {0x008B: 3},
}
WRONG = [("sj200", named) for named in SETTINGS if named != "sj200"]
WRONG += [(unit, "sj200") for unit in SETTINGS if unit != "sj200"]


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "sj200"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "sj200", unverified=True)


def program(line: Simulator, drive: Any) -> list[Callable[[], Any]]:
    return [
        lambda: drive.run(10.0),
        lambda: drive.wait_for_speed(10.0, timeout=100),
        lambda: drive.run(12.5, reverse=True),
        lambda: drive.wait_for_speed(12.5, timeout=100),
        lambda: line.drive(1).trip(1),
        drive.reset_fault,
        drive.stop,
        lambda: drive.wait_until_stopped(timeout=100),
    ]


WHOLE = [
    "06 00 01 00 64",  # 10.0 Hz
    "05 00 02 FF 00",  # forward
    "05 00 01 FF 00",  # run
    "06 00 01 00 7D",  # 12.5 Hz
    "05 00 02 00 00",  # reverse
    "05 00 01 FF 00",  # run
    "05 00 04 FF 00",  # reset
    "05 00 01 00 00",  # stop
]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert written(line) == WHOLE


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "sj200", program)
    assert written(line) == WHOLE


def test_a_run_is_the_frame_of_its_manual() -> None:
    with Simulator({10: "sj200"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        bus.drive(10, "sj200", unverified=True).run(10.0)
        assert RUN in [frame for _, side, frame in line.line.trace() if side == "master"]


def test_forward_and_reverse_are_the_right_way_round(line: Simulator, drive: Drive) -> None:
    drive.run(10.0)
    line.advance(30.0)
    assert (drive.status().state, line.drive(1).frequency) == (State.FORWARD, 10.0)
    drive.stop()
    drive.wait_until_stopped(timeout=60.0)
    drive.run(reverse=True)
    line.advance(30.0)
    assert (drive.status().state, line.drive(1).frequency) == (State.REVERSE, -10.0)


def test_a_coil_that_was_never_written_is_reverse(line: Simulator) -> None:
    """So a run alone would turn it in reverse: the direction goes out before each run."""
    with Bus(line) as bus:
        bus.transact(1, bytes.fromhex("05 0001 FF00"))
    line.advance(1.0)
    assert line.drive(1).state == "reverse"


@pytest.mark.parametrize(
    ("request_", "exception"),
    [
        ("04 00 01 00 01", 0x01),
        ("05 00 00 FF 00", 0x02),
        ("06 00 01 0F A1", 0x21),
        ("06 00 0A 00 01", 0x22),
    ],
)
def test_it_refuses_as_the_manual_of_its_sister_says(line: Simulator, request_: str, exception: int) -> None:
    """L200 manual (manualsonline l200), p. 233 (B-17)."""
    asked = bytes.fromhex(request_)
    with Bus(line) as bus, pytest.raises(drivebus.Refused) as refused:
        bus.transact(1, asked)
    assert refused.value.code == exception


def test_the_last_trips_are_three_words(line: Simulator) -> None:
    """P. B-11 (easymanua.ls sj200-series, p. 225): 05 03 00 19 00 03 reads them, and 00FFH is no trip."""
    with Bus(line) as bus:
        assert bus.read(1, 0x0019, 3) == [255, 255, 255]
    profile = Profile.builtin("sj200")
    assert [profile.fields("trip_1", word) for word in (7, 9, 255)] == [
        {"cause": "E07, overvoltage"},
        {"cause": "E09, undervoltage"},
        {"cause": "no trip"},
    ]


def test_nothing_but_a_write_by_its_address_trips_it(line: Simulator, drive: Drive) -> None:
    """P. B-19: coil 0003H, 1 is an external trip. It lets a turning motor go."""
    drive.run(10.0)
    line.advance(30.0)
    with pytest.raises(drivebus.NotAllowed):
        drive.write("external_trip", 1)
    assert line.drive(1).frequency == 10.0


def test_two_that_are_alike_are_known_by_their_answers() -> None:
    with Simulator({1: "sj200", 2: "wj200"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        assert [bus.identify(unit).family for unit in (1, 2)] == ["sj200", "wj200"]


def obeying(line: Simulator, family: str) -> None:
    with Bus(line) as bus:
        for address, word in SETTINGS[family].items():
            bus.write(1, address, word)
    line.drive(1).take_writes()


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("unit", "named"), WRONG)
def test_by_a_wrong_name_nothing_is_written(unit: str, named: str, start: str) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        obeying(line, unit)
        with Bus(line) as bus:
            drive = bus.drive(1, named, unverified=True)
            # Where nothing is in fault nothing is reset.
            with suppress(DrivebusError) if start == "reset" else pytest.raises((DrivebusError, ValueError)):
                STARTS[start](drive)
        assert line.drive(1).writes() == []
        assert (line.drive(1).state, line.drive(1).speed) == ("stopped", 0.0)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize(("unit", "named"), [("sj200", "wj200"), ("wj200", "sj200")])
def test_one_that_is_named_as_the_other_is_stopped_by_its_own_coil(unit: str, named: str, reverse: bool) -> None:
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            bus.drive(1, unit, unverified=True).run(10.0, reverse=reverse)
            line.advance(30.0)
        before = written(line)
        assert line.drive(1).frequency == pytest.approx(-10.0 if reverse else 10.0)
        with Bus(line) as bus:
            bus.drive(1, named, unverified=True).stop()
        *tried, last = written(line)[len(before) :]
        assert last == ("05 00 01 00 00" if unit == "sj200" else "05 00 00 00 00")
        # An SJ200 has no coil 0000H. The other way round nothing is tried: that would turn a WJ200 forward.
        assert set(tried) <= ({"05 00 00 00 00"} if unit == "sj200" else set())
        assert line.drive(1).state == "stopped"


def test_no_other_family_is_taken_for_one() -> None:
    for family in set(drivebus.profiles()) - {"sj200", "huanyang-hy"}:
        with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
            assert bus.identify(1).family != "sj200", family
