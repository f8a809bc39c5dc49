"""A Hitachi X200 from a program, and beside its sisters.

A WJ200 has its coils, and the direction the other way round; an SJ200 runs by the coil that is its direction.

X200 manual, p. B-12 (manualsdir 355636, p. 255): 08 05 00 00 FF 00 8C A3 runs unit 8. P. B-13 (azmanual 355636, p.
256): 08 06 10 28 01 F4 0D 8C writes 50 Hz to A020. P. B-16 (p. 259): 08 10 10 13 00 02 04 00 04 93 E0 7D 53 writes
3000 s to F002. P. B-19 (manualsdir, p. 262): coil 0002h is 0 for reverse and 1 for forward. Bytes are typed by hand;
judged is the drive's own log. What becomes of the others by its name, and of it by theirs: test_other_names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

import drivebus
from drivebus import Bus, Drive, DrivebusError, Profile, Simulator, State

from .jobs import carry_out_awaited
from .on_the_wire import written

RUN = bytes.fromhex("08 05 00 00 FF 00 8C A3")
MULTI_SPEED = bytes.fromhex("08 06 10 28 01 F4 0D 8C")
ACCELERATION = bytes.fromhex("08 10 10 13 00 02 04 00 04 93 E0 7D 53")

SISTERS = ["sj200", "wj200"]


@pytest.fixture
def line() -> Iterator[Simulator]:
    with Simulator({1: "x200"}, transport="process", clock="virtual") as line:
        yield line


@pytest.fixture
def drive(line: Simulator) -> Iterator[Drive]:
    with Bus(line) as bus:
        yield bus.drive(1, "x200")


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
    "05 00 01 FF 00",  # forward
    "05 00 00 FF 00",  # run
    "06 00 01 00 7D",  # 12.5 Hz
    "05 00 01 00 00",  # reverse
    "05 00 00 FF 00",  # run
    "05 00 03 FF 00",  # reset
    "05 00 00 00 00",  # stop
]


def test_a_whole_job(line: Simulator, drive: Drive) -> None:
    for step in program(line, drive):
        step()
    assert written(line) == WHOLE


def test_a_whole_job_awaited(line: Simulator) -> None:
    carry_out_awaited(line, "x200", program)
    assert written(line) == WHOLE


def test_frames_are_those_of_its_manual() -> None:
    with Simulator({8: "x200"}, transport="process", clock="virtual") as line, Bus(line) as bus:
        drive = bus.drive(8, "x200", unverified=True)
        drive.run(10.0)
        drive.stop()
        drive.wait_until_stopped(timeout=60.0)
        drive.write("A020", 50.0, store=True)
        drive.write("F002", 3000, store=True)
        sent = [frame for _, side, frame in line.line.trace() if side == "master"]
        assert {RUN, MULTI_SPEED, ACCELERATION} <= set(sent)


def test_forward_and_reverse_are_the_right_way_round(line: Simulator, drive: Drive) -> None:
    """The state is a coil that tells of no way; another one does, and is 1 for reverse."""
    for hertz, reverse, way in ((10.0, False, 0), (-10.0, True, 1)):
        drive.run(10.0, reverse=reverse)
        line.advance(30.0)
        assert (drive.status().state, line.drive(1).frequency) == (State.RUNNING, hertz)
        assert drive.read("direction_status") == way
        drive.stop()
        drive.wait_until_stopped(timeout=60.0)


def test_a_coil_that_was_never_written_is_reverse(line: Simulator) -> None:
    """So a run alone would turn it in reverse: the direction goes out before each run."""
    with Bus(line) as bus:
        bus.transact(1, bytes.fromhex("05 0000 FF00"))
    line.advance(1.0)
    assert line.drive(1).state == "reverse"


@pytest.mark.parametrize(
    ("request_", "exception"),
    [
        ("04 00 01 00 01", 0x01),
        ("03 12 00 00 01", 0x02),
        ("06 00 01 0F A1", 0x21),
        ("06 10 01 00 01", 0x22),
    ],
)
def test_it_refuses_as_the_manual_of_its_sister_says(line: Simulator, request_: str, exception: int) -> None:
    """L200 manual (manualsonline l200), p. 233 (B-17)."""
    asked = bytes.fromhex(request_)
    with Bus(line) as bus, pytest.raises(drivebus.Refused) as refused:
        bus.transact(1, asked)
    assert refused.value.code == exception


def test_the_last_trip_is_told_in_words() -> None:
    """P. 255 (B-12): 0003h is E03."""
    assert Profile.builtin("x200").fields("trip_factor", 3) == {"cause": "E03"}


def test_nothing_but_a_write_by_its_address_trips_it(line: Simulator, drive: Drive) -> None:
    """P. 262 (B-19): coil 0003h, 1 is an external trip. It lets a turning motor go."""
    drive.run(10.0)
    line.advance(30.0)
    with pytest.raises(drivebus.NotAllowed):
        drive.write("external_trip", 1)
    assert line.drive(1).frequency == 10.0


def test_three_that_are_alike_are_known_by_their_answers() -> None:
    units = {1: "sj200", 2: "wj200", 3: "x200"}
    with Simulator(units, transport="process", clock="virtual") as line, Bus(line) as bus:
        assert {unit: bus.identify(unit).family for unit in units} == units


@pytest.mark.parametrize("sister", SISTERS)
@pytest.mark.parametrize("is_the_sister", [False, True])
@pytest.mark.parametrize("hertz", [5.0, 50.0])
def test_a_sisters_setpoint_is_not_taken(sister: str, hertz: float, *, is_the_sister: bool) -> None:
    """All three have it at 0001H; a WJ200 counts hundredths."""
    unit, named = (sister, "x200") if is_the_sister else ("x200", sister)
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus, pytest.raises(DrivebusError):
            bus.drive(1, named, unverified=True).setpoint = hertz
        assert line.drive(1).writes() == []


STOPS = {"x200": "05 00 00 00 00", "wj200": "05 00 00 00 00", "sj200": "05 00 01 00 00"}
"""An X200 and a WJ200 stop by the same word, and an SJ200 has nothing there."""


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("sister", SISTERS)
@pytest.mark.parametrize("is_the_sister", [False, True])
def test_one_that_is_named_as_a_sister_is_stopped_by_its_own_coil(
    sister: str, *, is_the_sister: bool, reverse: bool
) -> None:
    unit, named = (sister, "x200") if is_the_sister else ("x200", sister)
    with Simulator({1: unit}, transport="process", clock="virtual") as line:
        with Bus(line) as bus:
            bus.drive(1, unit, unverified=True).run(10.0, reverse=reverse)
            line.advance(30.0)
        before = written(line)
        assert line.drive(1).frequency == pytest.approx(-10.0 if reverse else 10.0)
        with Bus(line) as bus:
            bus.drive(1, named, unverified=True).stop()
        *tried, last = written(line)[len(before) :]
        assert last == STOPS[unit]
        # An SJ200's is not tried on an X200: that would turn it round.
        assert set(tried) <= {STOPS["x200"]}
        assert line.drive(1).state == "stopped"


def test_no_other_family_is_taken_for_one() -> None:
    for family in set(drivebus.profiles()) - {"x200", "huanyang-hy"}:
        with Simulator({1: family}, transport="process", clock="virtual") as line, Bus(line) as bus:
            assert bus.identify(1).family != "x200", family
