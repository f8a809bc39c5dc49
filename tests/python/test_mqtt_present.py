"""What a broker is told of now: what changed, seldom enough, and nothing old as if it were new. Time is an argument."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from drivebus.sinks import DrivePicture, LinePicture, MqttDrive, Picture
from drivebus.sinks.mqtt_messages import batches, event, moment
from drivebus.sinks.mqtt_present import Present
from drivebus.sinks.mqtt_topics import Place, Topics, why_no_level, why_no_prefix
from drivebus.spool import Layout, Spooled

TOPICS = Topics("drivebus", "hall")
LAYOUT = Layout("pump", "gd350", ("running_frequency", "status_word_1"), ("Hz", ""), (2, 0))
SLOW = Layout("pump", "gd350", ("energy",), ("kWh",), (1,))


def present() -> Present:
    return Present([MqttDrive("pump", "INVT", "GD350", fresh={1: 12.0, 2: 200.0})], TOPICS)


def said(of: Present, now: float, *drives: DrivePicture, wall: float | None = None) -> list[dict[str, Any]]:
    """The states that are said of *drives* at *now*."""
    picture = Picture(now if wall is None else wall, (LinePicture("hall", True, {}, drives),))
    found = []
    for due in of.due(picture, now):
        state, availability = due.messages
        assert state.keeps
        assert availability.keeps
        told = json.loads(state.payload)
        assert (availability.payload == b"online") == (told["quality"] == "good")
        found.append(told)
        of.was_said(due, now)
    return found


def drive(at: float, *values: float, poll: int = 1, missing: str = "", layout: Layout = LAYOUT) -> DrivePicture:
    return DrivePicture(poll, layout, at, missing, values, "" if missing else "forward")


def test_what_changed_is_said_and_the_rest_each_half_minute() -> None:
    of = present()
    [first] = said(of, 100.0, drive(99.5, 10.0, 1))
    assert first == {
        "time": "1970-01-01T00:01:39.500Z",
        "age": 0.5,
        "quality": "good",
        "state": "forward",
        "fault": None,
        "values": {"running_frequency": 10.0, "status_word_1": 1},
    }
    assert said(of, 100.5, drive(100.4, 11.0, 1)) == []
    [changed] = said(of, 101.0, drive(100.4, 11.0, 1))
    assert changed["values"]["running_frequency"] == 11.0
    assert said(of, 130.9, drive(130.4, 11.0, 1)) == []
    [again] = said(of, 131.0, drive(130.4, 11.0, 1))
    assert again["age"] == 0.6


def test_a_drive_that_is_gone_has_no_values() -> None:
    of = present()
    said(of, 100.0, drive(100.0, 10.0, 1))
    [gone] = said(of, 101.0, drive(101.0, missing="unit 1: no answer"))
    assert (gone["quality"], gone["values"], gone["missing"]) == ("gone", {}, "unit 1: no answer")
    assert gone["state"] is None


def test_a_value_that_is_old_is_not_shown() -> None:
    of = present()
    said(of, 100.0, drive(100.0, 10.0, 1))
    assert said(of, 112.0, drive(100.0, 10.0, 1)) == []
    [gone] = said(of, 112.1, drive(100.0, 10.0, 1))
    assert (gone["quality"], gone["values"], gone["age"]) == ("gone", {}, 12.1)


def test_a_clock_that_was_set_back_makes_nothing_fresh() -> None:
    [gone] = said(present(), 100.0, drive(100.0, 10.0, 1), wall=-86_300.0)
    assert (gone["quality"], gone["age"]) == ("gone", 0.0)


def test_a_line_that_is_away_has_no_values() -> None:
    [gone] = said(present(), 100.0)
    assert (gone["quality"], gone["values"]) == ("gone", {})
    assert "age" not in gone


def test_what_an_earlier_poll_said_has_its_own_time() -> None:
    of = present()
    slow = drive(50.0, 1_000.0, poll=2, layout=SLOW)
    [both] = said(of, 100.0, drive(99.0, 10.0, 1), slow)
    assert both["values"] == {"energy": 1_000.0, "running_frequency": 10.0, "status_word_1": 1}
    assert both["times"] == {"energy": "1970-01-01T00:00:50.000Z"}
    assert both["age"] == 1.0
    [one] = said(of, 260.0, drive(259.0, 10.0, 1), slow)
    assert "energy" not in one["values"]


def test_a_broker_that_forgot_is_told_anew() -> None:
    of = present()
    assert said(of, 100.0, drive(100.0, 10.0, 1))
    of.forget()
    assert said(of, 100.1, drive(100.0, 10.0, 1))


def test_what_is_no_number_is_none() -> None:
    [told] = said(present(), 100.0, drive(100.0, float("nan"), float("inf")))
    assert told["values"] == {"running_frequency": None, "status_word_1": None}


@given(st.lists(st.text(max_size=300), max_size=30), st.integers(1, 2_000))
def test_batches_have_all_in_their_order(words: Sequence[str], largest: int) -> None:
    samples = [Spooled(seq, "e", LAYOUT, 0.0, 0.1, text or "x", ()) for seq, text in enumerate(words, 1)]
    made = list(batches(samples, largest))
    read = [sample for batch in made for sample in json.loads(batch)]
    assert [(each["seq"], each["missing"]) for each in read] == [(each.seq, each.missing) for each in samples]
    assert all(len(batch) <= largest or len(json.loads(batch)) == 1 for batch in made)


def test_an_event_and_a_sample() -> None:
    noted = Spooled(7, "e", Layout.of_events("pump", "fault"), 1.5, 0.0, "<b>\n", ())
    assert event(noted) == {
        "epoch": "e",
        "seq": 7,
        "time": "1970-01-01T00:00:01.500Z",
        "subject": "pump",
        "kind": "fault",
        "text": "<b>\n",
    }
    [batch] = batches([Spooled(8, "e", LAYOUT, 2.0, 0.25, "", (1.5, 3))], 1_000)
    assert json.loads(batch) == [
        {
            "epoch": "e",
            "seq": 8,
            "time": "1970-01-01T00:00:02.000Z",
            "took": 0.25,
            "drive": "pump",
            "values": {"running_frequency": 1.5, "status_word_1": 3},
        }
    ]


def test_moments_are_utc() -> None:
    assert moment(1_767_225_600.0004) == "2026-01-01T00:00:00.000Z"


def test_what_can_be_a_level_of_a_topic() -> None:
    for name in ("hall 1", "Halle Süd", "a.b", "x" * 100):
        assert why_no_level(name) == ""
    for name in ("a/b", "+", "a#", "", " ", "a\0", "a\nb", "\x1b[31m", "$SYS", "x" * 101, "ü" * 51, "a\u2028b"):
        assert why_no_level(name) != "", name
    assert why_no_prefix("plant/hall") == ""
    for name in ("", "/", "a/", "/a", "a//b", "a/#"):
        assert why_no_prefix(name) != "", name


def test_what_a_topic_means() -> None:
    assert TOPICS.place("drivebus/hall/pump/cmd/run") == Place("pump", "cmd", "run")
    assert TOPICS.place("drivebus/hall/pump/state") == Place("pump", "state")
    assert TOPICS.place("drivebus/hall/pump/availability") == Place("pump", "availability")
    for topic in ("drivebus/hall/pump/cmd", "drivebus/hall/pump/cmd/run/now", "drivebus/hall/availability"):
        assert TOPICS.place(topic) is None, topic
    for topic in ("drivebus/other/pump/cmd/run", "drivebus/hall/pump/state/x", "homeassistant/status", ""):
        assert TOPICS.place(topic) is None, topic
