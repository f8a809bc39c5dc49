"""Choices, snapshots, statistics and states as plain values."""

from __future__ import annotations

import copy
import pickle
from typing import get_type_hints

import pytest

import drivebus
from drivebus import Choice, Control, ControlItem, Fault, Link, Snapshot, State, Stats


def test_a_choice_is_its_number_and_shows_its_label() -> None:
    choice = Choice(2, "communication")
    assert choice == 2
    assert isinstance(choice, int)
    assert str(choice) == f"{choice}" == "communication"
    assert repr(choice) == "Choice(2, 'communication')"
    assert {2: "x"}[choice] == "x"
    for same in (pickle.loads(pickle.dumps(choice)), copy.deepcopy(choice)):
        assert (same, same.label) == (2, "communication")


def test_a_snapshot_is_a_mapping_with_attributes() -> None:
    snapshot = Snapshot({"current": 1.5, "speed": 300}, {"current": "A", "speed": "rpm"}, 10.0, 0.02)
    assert dict(snapshot) == {"current": 1.5, "speed": 300}
    assert snapshot.current == snapshot["current"] == 1.5
    assert (snapshot.time, snapshot.duration, snapshot.units["speed"]) == (10.0, 0.02, "rpm")
    assert repr(snapshot) == "Snapshot(current=1.5 A, speed=300 rpm)"
    assert "current" in dir(snapshot)
    with pytest.raises(AttributeError, match='does not hold "voltage", only current, speed'):
        _ = snapshot.voltage
    assert pickle.loads(pickle.dumps(snapshot)) == snapshot


def test_statistics_nest() -> None:
    stats = Stats({"requests": 3, "units": {1: {"requests": 2}}})
    assert stats.requests == stats["requests"] == 3
    assert stats.units[1].requests == 2
    assert repr(stats) == "Stats(requests=3, units={1: UnitStats(requests=2)})"
    with pytest.raises(AttributeError, match='does not hold "answers", only requests, units'):
        _ = stats.answers


def test_statistics_have_what_their_types_say() -> None:
    with drivebus.Bus("sim://gd350?clock=virtual") as bus:
        bus.read(1, 0x2100)
        stats = bus.stats()
    assert set(stats) == {*get_type_hints(type(stats))} - {"_values"}
    unit = stats.units[1]
    assert set(unit) == {*get_type_hints(type(unit))} - {"_values"}
    assert set(unit.round_trip) == {*get_type_hints(type(unit.round_trip))} - {"_values"}
    assert all(type(unit[name]) is kind for name, kind in get_type_hints(type(unit)).items() if name in unit)


@pytest.mark.parametrize(("state", "running"), [(State.FORWARD, True), (State.REVERSE, True), (State.FAULT, False)])
def test_a_state_knows_whether_the_motor_is_driven(state: State, running: bool) -> None:
    assert state.running is running


def test_a_control_list_is_true_when_all_is_well() -> None:
    good = ControlItem("P00.01", 2, 2, True, True, "channel")
    bad = ControlItem("P00.06", 8, 0, False, False, "source")
    assert Control([good])
    assert not Control([good, bad])
    assert str(Control([good, bad])) == "P00.01 channel: 2, ok\nP00.06 source: 0, needs 8 [value unverified]"


def test_a_fault_says_when_it_is_not_sure() -> None:
    assert str(Fault(11, "OL1", "Motor overload")) == "OL1 (11): Motor overload"
    assert str(Fault(4, "OC1", "Overcurrent", verified=False)) == "OC1 (4): Overcurrent [unverified]"


def test_a_link_counts_what_failed_and_reads_as_a_sentence() -> None:
    assert Link(good=7, asked=10).failed == 3
    assert str(Link(7, 10)) == "7 of the last 10 exchanges brought an answer"
