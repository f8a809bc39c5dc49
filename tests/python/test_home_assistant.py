"""What Home Assistant is told of the drives of every family, held against what Home Assistant itself takes.

`home_assistant.json` has the keys of its schemas, and the units and state classes of its device classes, that an old
version and a new one both take, as they were read out of their own modules.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from drivebus.profile import Profile, profiles
from drivebus.service.over_mqtt import drive_of
from drivebus.sinks import MqttDrive, home_assistant
from drivebus.sinks.mqtt_present import REPEATS
from drivebus.sinks.mqtt_topics import Topics
from drivebus.site import SiteDrive, SiteLine, SitePoll

TAKES = json.loads(Path(__file__).with_name("home_assistant.json").read_text(encoding="utf-8"))
LINE = SiteLine("hall", "/dev/ttyUSB0")
TOPICS = Topics("drivebus", "hall 1")
ALL = frozenset({"run", "setpoint", "reset"})

Told = dict[str, dict[str, Any]]


def known(family: str, may: frozenset[str] = ALL, *, polled: bool = True, unverified: bool = False) -> MqttDrive:
    drive = SiteDrive("pump-1", LINE, 1, family, {}, unverified)
    return drive_of(drive, (SitePoll((drive,)),) if polled else (), may)


def told(drive: MqttDrive) -> Told:
    """What it is told, by what each entity is and is called."""
    found = {}
    for topic, payload in home_assistant.configs(drive, TOPICS, "homeassistant").items():
        matched = re.fullmatch(rf"homeassistant/([a-z_]+)/{TOPICS.node}/pump-1-([A-Za-z0-9_]+)/config", topic)
        assert matched is not None, topic
        found[f"{matched[1]} {matched[2]}"] = json.loads(payload)
    return found


def agree(given: dict[str, Any], keys: dict[str, list[str]]) -> None:
    assert set(given) <= {*keys["required"], *keys["optional"]}
    assert set(given) >= set(keys["required"])


@pytest.mark.parametrize("unverified", [False, True])
@pytest.mark.parametrize("family", profiles())
def test_every_family_is_told_as_home_assistant_wants_it(family: str, unverified: bool) -> None:
    found = told(known(family, unverified=unverified))
    assert len({each["unique_id"] for each in found.values()}) == len(found)
    for which, given in found.items():
        kind = which.split()[0]
        agree(given, TAKES["components"][kind])
        agree(given["device"], TAKES["device"])
        agree(given["origin"], TAKES["origin"])
        for each in given["availability"]:
            agree(each, TAKES["availability"])
        assert "entity_category" not in given or given["entity_category"] in TAKES["entity_categories"]
        if kind == "sensor":
            a_sensor(given)
        elif kind == "binary_sensor":
            assert given["device_class"] in TAKES["binary_sensor_classes"]
        elif kind == "number":
            assert given["mode"] in TAKES["number_modes"]
            assert given["unit_of_measurement"] in TAKES["number_units"][given["device_class"]]
            assert given["min"] < given["max"]


def a_sensor(given: dict[str, Any]) -> None:
    """It has the unit and the state class that go with its device class."""
    unit, kind, state = (given.get(key, "") for key in ("unit_of_measurement", "device_class", "state_class"))
    assert given["expire_after"] > REPEATS
    if kind == "enum":
        assert not unit
        assert not state
        return
    assert not kind or unit in TAKES["sensor_units"][kind]
    assert not state or state in (TAKES["sensor_state_classes"][kind] if kind else TAKES["state_classes"])
    # A number without a unit is one of bits, or nobody knows what it counts.
    assert bool(state) == bool(unit)


def test_every_unit_has_its_class() -> None:
    """Or Home Assistant has none for it."""
    units = {Profile.find(family).describe(name).unit for family in profiles() for name in Profile.find(family).names()}
    without = {"", "raw", "%", "rpm", "Nm", "Ω", "mH", "°"}
    classes = {unit for kind in TAKES["sensor_units"].values() for unit in kind} - {""}
    assert units - without <= classes
    assert not (without & classes)


def test_a_goodrive_that_may_be_told_all() -> None:
    found = told(known("gd350"))
    current = found["sensor output_current"]
    frequency = found["sensor running_frequency"]
    assert (current["device_class"], current["unit_of_measurement"], current["state_class"]) == (
        "current",
        "A",
        "measurement",
    )
    assert frequency["suggested_display_precision"] == 2
    assert found["number order_setpoint"]["max"] == 630.0
    assert found["number order_setpoint"]["state_topic"] == "drivebus/hall 1/pump-1/state"
    assert "set_frequency_actual" in found["number order_setpoint"]["value_template"]
    assert found["binary_sensor drive_fault"]["device_class"] == "problem"
    assert found["binary_sensor drive_answers"]["device_class"] == "connectivity"
    assert found["sensor drive_state"]["device_class"] == "enum"
    device = found["sensor drive_state"]["device"]
    assert (device["name"], device["manufacturer"], device["model"]) == ("pump-1", "INVT", "Goodrive350")
    run = found["button order_run_reverse"]
    assert run["command_topic"] == "drivebus/hall 1/pump-1/cmd/run"
    assert run["command_template"] == '{"time": {{ as_timestamp(now()) }}, "reverse": true}'
    assert [each["topic"] for each in run["availability"]] == [
        "drivebus/hall 1/availability",
        "drivebus/hall 1/pump-1/availability",
    ]


@pytest.mark.parametrize(
    ("may", "orders"),
    [
        (frozenset(), set()),
        ({"reset"}, {"button order_stop", "button order_coast", "button order_reset"}),
        ({"setpoint"}, {"button order_stop", "button order_coast", "number order_setpoint"}),
    ],
)
def test_only_what_may_be_ordered_is_offered(may: frozenset[str], orders: set[str]) -> None:
    assert {each for each in told(known("gd350", frozenset(may))) if " order_" in each} == orders


def test_a_drive_that_is_not_polled_has_its_buttons_alone() -> None:
    found = told(known("gd350", polled=False))
    assert {each.split()[0] for each in found} == {"button", "number"}
    assert found["button order_stop"]["availability"] == [
        {"topic": "drivebus/hall 1/availability", "payload_available": "online", "payload_not_available": "offline"}
    ]


def test_two_gateways_are_never_taken_for_one() -> None:
    names = ["hall 1", "hall_1", "hall-1", "hall  1", "Halle Süd", "Halle S_d"]
    assert len({Topics("drivebus", name).node for name in names}) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9_-]+", Topics("drivebus", name).node) for name in names)
