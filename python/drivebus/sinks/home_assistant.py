"""What Home Assistant is told of drives, so that it shows them by itself: an entity for all that each tells and takes.

One message for each entity: the one message for a whole device is understood by Home Assistant from 2024.11 on only.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from drivebus.sinks.mqtt_drives import MqttDrive, MqttValue
from drivebus.sinks.mqtt_messages import packed
from drivebus.sinks.mqtt_present import OFFLINE, ONLINE, REPEATS
from drivebus.sinks.mqtt_topics import Topics
from drivebus.sinks.order_words import HALTS

__all__ = ["born", "configs", "filter_of"]

_CLASSES = {
    "Hz": "frequency",
    "kHz": "frequency",
    "V": "voltage",
    "A": "current",
    "kW": "power",
    "kWh": "energy",
    "°C": "temperature",
    "s": "duration",
    "ms": "duration",
    "h": "duration",
}
"""The device classes of units that drives have. Of the others, such as rpm, Home Assistant has none."""
_GROWS = ("kWh", "h")
"""What is counted on and on: energy, and hours of running."""
_COUNTS = ("", "raw")
"""No units: words of bits, and numbers that only the manual explains."""
_EXPIRES = 2 * REPEATS + 15.0
"""Seconds after which a value is unknown that nobody says any more, should this gateway hang."""
_TIME = '"time": {{ as_timestamp(now()) }}'


def born(prefix: str) -> str:
    """The topic by which Home Assistant says that it has started."""
    return f"{prefix}/status"


def filter_of(prefix: str, topics: Topics) -> str:
    """All that was ever told of the drives of a gateway, to subscribe to."""
    return f"{prefix}/+/{topics.node}/+/config"


def configs(drive: MqttDrive, topics: Topics, prefix: str) -> Mapping[str, bytes]:
    """What is to be kept of *drive*: what each entity is, by its topic."""
    device = {
        "identifiers": [f"drivebus_{topics.node}_{drive.name}"],
        "name": drive.name,
        "manufacturer": drive.maker,
        "model": drive.model,
    }
    origin = {"name": "drivebus"}
    found: dict[str, bytes] = {}
    for component, key, told in _entities(drive, topics):
        # A name in a profile has no "-", so that no drive's entity is that of another one.
        entity = re.sub(r"[^A-Za-z0-9_]+", "_", key)
        named = {"unique_id": f"drivebus_{topics.node}_{drive.name}-{entity}", "device": device, "origin": origin}
        topic = f"{prefix}/{component}/{topics.node}/{drive.name}-{entity}/config"
        found[topic] = packed({**told, **named})
    return found


def _entities(drive: MqttDrive, topics: Topics) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Each entity: what it is, what it is called here, and what Home Assistant is told."""
    here = {"topic": topics.availability, **_SAYS}
    if drive.fresh:
        there = {"topic": topics.of(drive.name, "availability"), **_SAYS}
        state = topics.of(drive.name, "state")
        both = {"availability": [here, there], "availability_mode": "all"}
        seen = {**both, "state_topic": state, "expire_after": int(_EXPIRES)}
        yield from (("sensor", each.name, {**seen, **_sensor(each)}) for each in drive.values)
        if drive.tells_state:
            yield "sensor", "drive_state", {**seen, **_STATE}
        if drive.tells_fault:
            yield "binary_sensor", "drive_fault", {**seen, **_FAULT, "json_attributes_topic": state}
        answers = {"state_topic": there["topic"], "payload_on": ONLINE.decode(), "payload_off": OFFLINE.decode()}
        yield "binary_sensor", "drive_answers", {**_CONNECTED, **answers, "availability": [here]}
    else:
        both = {"availability": [here], "availability_mode": "all"}
    for order, key, name, icon, words in _BUTTONS:
        if order in drive.may or (drive.may and order in HALTS):
            told = {"name": name, "icon": icon, "command_topic": topics.order(drive.name, order), "qos": 1}
            yield "button", key, {**both, **told, "command_template": "{" + words + "}"}
    if "setpoint" in drive.may and drive.highest:
        yield "number", "order_setpoint", {**both, **_setpoint(drive, topics)}


_SAYS = {"payload_available": ONLINE.decode(), "payload_not_available": OFFLINE.decode()}
# Which states there are is not said: Home Assistant 2024.3 does not know that key yet.
_STATE = {
    "name": "State",
    "device_class": "enum",
    "value_template": "{{ value_json.state }}",
    "icon": "mdi:engine",
}
_FAULT = {
    "name": "Fault",
    "device_class": "problem",
    "value_template": "{% if value_json.quality != 'good' %}None{% elif value_json.fault %}ON{% else %}OFF{% endif %}",
    "json_attributes_template": "{{ {'fault': value_json.fault} | tojson }}",
}
_CONNECTED = {"name": "Answers", "device_class": "connectivity", "entity_category": "diagnostic"}
_BUTTONS = (
    ("stop", "order_stop", "Stop", "mdi:stop", _TIME),
    ("coast", "order_coast", "Coast", "mdi:stop-circle-outline", _TIME),
    ("reset", "order_reset", "Reset fault", "mdi:restart-alert", _TIME),
    ("run", "order_run_forward", "Run forward", "mdi:play", _TIME),
    ("run", "order_run_reverse", "Run in reverse", "mdi:play", f'{_TIME}, "reverse": true'),
)
"""What is ordered, what that is called here and for people, and what is said."""


def _sensor(value: MqttValue) -> dict[str, Any]:
    told: dict[str, Any] = {
        "name": value.label or value.name,
        "value_template": f"{{{{ value_json['values'].get('{value.name}') }}}}",
    }
    if value.unit in _COUNTS:
        return told
    told["unit_of_measurement"] = value.unit
    told["state_class"] = "total_increasing" if value.unit in _GROWS else "measurement"
    told["suggested_display_precision"] = value.digits
    if value.unit in _CLASSES:
        told["device_class"] = _CLASSES[value.unit]
    return told


def _setpoint(drive: MqttDrive, topics: Topics) -> dict[str, Any]:
    told: dict[str, Any] = {
        "name": "Setpoint",
        "device_class": "frequency",
        "unit_of_measurement": "Hz",
        "min": 0,
        "max": drive.highest,
        "step": max(drive.step, 0.001),
        "mode": "box",
        "command_topic": topics.order(drive.name, "setpoint"),
        "command_template": f'{{{_TIME}, "hz": {{{{ value }}}}}}',
        "qos": 1,
    }
    if drive.in_force:
        # What the drive follows, and not what was typed.
        told["state_topic"] = topics.of(drive.name, "state")
        told["value_template"] = f"{{{{ value_json['values'].get('{drive.in_force}') }}}}"
    return told
