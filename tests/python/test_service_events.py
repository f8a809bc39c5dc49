"""What happened is told once, by what a drive said before; and it is kept where the samples are."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivebus.service.events import KINDS, Event, Events
from drivebus.sinks import DrivePicture
from drivebus.spool import Layout, Spool

PUMP = Layout("pump", "gd350", ("running_frequency",), ("Hz",), (2,))


def said(at: float, state: str = "", fault: str = "", missing: str = "") -> DrivePicture:
    return DrivePicture(1, PUMP, at, missing, () if missing else (10.0,), state, fault)


STORIES: dict[str, tuple[list[DrivePicture], list[tuple[str, str]]]] = {
    "all is well": ([said(1, "stopped"), said(2, "stopped")], []),
    "it starts and stops": (
        [said(1, "stopped"), said(2, "forward"), said(3, "forward"), said(4, "stopped")],
        [("state", "stopped, now forward"), ("state", "forward, now stopped")],
    ),
    "it trips, and is reset": (
        [
            said(1, "forward"),
            said(2, "fault", "OL1 (11): overload"),
            said(3, "fault", "OL1 (11): overload"),
            said(4, "stopped"),
        ],
        [("fault", "in fault: OL1 (11): overload"), ("cleared", "out of fault: stopped")],
    ),
    "one fault after another": (
        [said(1, "fault", "OL1"), said(2, "fault", "OC1")],
        [("fault", "in fault: OL1"), ("fault", "in fault: OC1")],
    ),
    "it was in a fault when it was asked first": ([said(1, "fault", "OL1")], [("fault", "in fault: OL1")]),
    "it is unplugged, for two different reasons": (
        [said(1, "stopped"), said(2, missing="no answer"), said(3, missing="not asked"), said(4, "stopped")],
        [("gone", "gives no values: no answer"), ("back", "answers again: stopped")],
    ),
    "it was never there": (
        [said(1, missing="no answer"), said(2, missing="no answer")],
        [("gone", "gives no values: no answer")],
    ),
    "it comes back in a fault": (
        [said(1, "forward"), said(2, missing="no answer"), said(3, "fault", "UV")],
        [("gone", "gives no values: no answer"), ("back", "answers again: fault"), ("fault", "in fault: UV")],
    ),
    "a family that tells no state": ([said(1), said(2)], []),
}


@pytest.mark.parametrize("story", STORIES)
def test_a_change_is_told_once(story: str) -> None:
    pictures, expected = STORIES[story]
    events = Events(lambda _: None, None)
    for picture in pictures:
        events.saw(picture)
    assert [(each.kind, each.text) for each in events.last()] == expected
    assert {each.kind for each in events.last()} <= KINDS.keys()
    assert all(each.subject == "pump" and each.time in (1, 2, 3, 4) for each in events.last())


def test_events_wait_with_the_samples_in_their_order(tmp_path: Path) -> None:
    heard: list[str] = []
    with Spool(tmp_path / "spool", 1 << 30, heard.append) as spool:
        events = Events(heard.append, spool, clock=lambda: 7.0)
        spool.add(PUMP, 6.0, 0.01, "", [10.0])
        events.note("hall", "away", "x" * 5_000 + "\N{ESCAPE}[2J")
        spool.add(PUMP, 8.0, 0.01, "", [11.0])
    with Spool(tmp_path / "spool", 1 << 30, heard.append) as spool:
        found = spool.reader("test").after(0, 10)
    assert [each.layout.event for each in found] == ["", "away", ""]
    assert found[1].layout == Layout.of_events("hall", "away")
    assert (found[1].time, found[1].missing, found[1].values) == (7.0, "x" * 1_000, ())
    assert events.last() == [Event(7.0, "hall", "away", "x" * 1_000)]


def test_the_last_ones_are_kept_and_no_more() -> None:
    events = Events(lambda _: None, None)
    for number in range(2_000):
        events.note("hall", "told", str(number))
    assert [each.text for each in events.last()] == [str(number) for number in range(1_500, 2_000)]
