"""A plant over MQTT: its drives as the sink wants to know them, and what may be ordered there.

What is refused is told to whoever asked; among the events it is told a few times a minute, so that nobody floods a log.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from drivebus import checks
from drivebus.operations import glances
from drivebus.profile.evidence import Evidence
from drivebus.service.dispatch import Dispatch
from drivebus.service.events import Events
from drivebus.service.mistakes import evidence_of, mqtt_settings_of
from drivebus.service.orders import Door, Order, Orders, Outcome
from drivebus.service.plant import Plant
from drivebus.service.polling import layout_of
from drivebus.sinks import Answer, Command, Commander, Mqtt, MqttDrive, MqttValue
from drivebus.sinks.order_words import ORDERS
from drivebus.site import SiteDrive, SiteMqtt, SitePoll
from drivebus.values import digits_of

__all__ = ["OverMqtt", "drive_of"]

_DOOR = "mqtt"
_HIGHEST = 400.0
"""Hz that are offered where a family's documents name no highest: the drive itself refuses what is too much."""
_PATIENCE = 10.0
"""Seconds that an answer is shown as one of now, beyond twice the time from one question to the next."""
_REFUSED, _PER = 10, 60.0
"""So many refusals are told in so many seconds."""


class OverMqtt:
    """What a service has at a broker.

    Args:
        plant: What is told there, and may be ordered.
        told: What its file says of MQTT.
    """

    def __init__(self, plant: Plant, told: SiteMqtt) -> None:
        site = plant.site
        drives = [drive_of(drive, site.polls, told.may.get(name, frozenset())) for name, drive in site.drives.items()]
        commander = None
        self._over = threading.Event()
        if told.may:
            watch = _Watch(told.may, told.dead_man, plant.events, plant.orders, self._over.is_set)
            commander = Commander(watch.give, watch.not_taken, watch.depends, watch.silent)
        self._mqtt = Mqtt(mqtt_settings_of(told), drives, plant.look, plant.spool, commander, plant.tell)
        self.start = self._mqtt.start

    def turn(self) -> None:
        """Its own threads do all."""

    def close(self) -> None:
        """Ends within a second or two."""
        self._over.set()
        self._mqtt.close()

    def status(self) -> dict[str, Any]:
        """How it does, in plain words and numbers."""
        return self._mqtt.status()


def drive_of(drive: SiteDrive, polls: tuple[SitePoll, ...], may: frozenset[str]) -> MqttDrive:
    """What is known of *drive*, of which *polls* may ask, and which *may* be told something.

    Raises:
        NotAllowed: There is no such family.
    """
    if drive.profile is None:
        return MqttDrive(drive.name, "", "", may=may)
    evidence = evidence_of(drive)
    profile = evidence.profile
    asked = [(place, poll) for place, poll in enumerate(polls, 1) if drive in poll.drives]
    layouts = [layout_of(drive.name, evidence, poll.registers) for _, poll in asked]
    names = dict.fromkeys(name for layout in layouts for name in layout.names)
    values = tuple(_value(evidence, name) for name in names)
    maker, _, model = profile.title.partition(" ")
    tells = glances.planned(evidence)
    highest, step = _setpoints(evidence)
    in_force = profile.role("setpoint") or ""
    return MqttDrive(
        name=drive.name,
        maker=maker,
        model=model,
        fresh={place: 2 * poll.interval + _PATIENCE for place, poll in asked},
        values=values,
        tells_state=tells.state is not None,
        tells_fault=tells.fault is not None or tells.state is not None,
        may=may,
        highest=highest,
        step=step,
        in_force=in_force if in_force in names and profile.describe(in_force).unit == "Hz" else "",
    )


def _value(evidence: Evidence, name: str) -> MqttValue:
    row = evidence.profile.describe(name)
    return MqttValue(name, row.label, row.unit, digits_of(row.scale))


def _setpoints(evidence: Evidence) -> tuple[float, float]:
    """The highest setpoint in Hz, and from one to the next; 0.0: none in Hz is known."""
    register = evidence.profile.role("setpoints.frequency")
    if register is None:
        return 0.0, 0.0
    row = evidence.profile.describe(register)
    if row.unit != "Hz":
        return 0.0, 0.0
    return float(row.high or _HIGHEST), 1 / row.scale


class _Watch:
    """The door, and what was set in motion by it."""

    def __init__(
        self,
        may: dict[str, frozenset[str]],
        dead_man: float | str | None,
        events: Events,
        orders: Orders,
        is_over: Callable[[], bool],
    ) -> None:
        self._door = Door(_DOOR, may)
        self._dead_man = dead_man if isinstance(dead_man, float) else math.inf
        self._events = events
        self._orders = orders
        self._is_over = is_over
        self._dispatch = Dispatch(orders, self._door)
        self._halted: set[str] = set()
        self._told: deque[float] = deque()

    def give(self, command: Command, done: Callable[[Answer], None]) -> None:
        """Has *command* carried out."""
        order = Order(command.drive, command.order, command.hz, command.reverse)
        who = f"command {checks.shown(command.id)}" if command.id else "somebody"
        if order.what not in ORDERS:
            why = f"there is no order {checks.shown(order.what)}; there are {', '.join(ORDERS)}"
        elif order.drive not in self._door.may:
            why = f"there is no drive {checks.shown(order.drive)} that may be told anything here"
        else:
            why = self._door.why_not(order)
        if why:
            self.not_taken(order.drive, f"{checks.shown(order.what)}: {why}")
            done(Answer("not sent", why))
            return
        until = time.monotonic() + command.left
        self._dispatch.give(order, who, until, lambda outcome: done(_answer(outcome)))

    def not_taken(self, drive: str, why: str) -> None:
        """Tells that something was no order, and *why*; unless that was told many times just now."""
        now = time.monotonic()
        while self._told and self._told[0] < now - _PER:
            self._told.popleft()
        if len(self._told) < _REFUSED:
            self._told.append(now)
            subject = drive if drive in self._door.may else _DOOR
            self._events.note(subject, "order", f"nothing was carried out that came by {_DOOR}: {why}")

    def depends(self) -> bool:
        """Whether a motor turns that was told so here, and is halted where the broker is gone."""
        return self._dead_man < math.inf and bool(self._orders.started_by(_DOOR))

    def silent(self, seconds: float) -> None:
        """Halts what turns where the broker gave no sign of life for too many *seconds*."""
        if seconds <= self._dead_man:
            self._halted.clear()
            return
        started = set(self._orders.started_by(_DOOR))
        if started - self._halted:
            self._halted |= started
            self._orders.shut(_DOOR, f"has not heard of its broker for {self._dead_man:g} s", self._is_over)


def _answer(outcome: Outcome) -> Answer:
    return Answer(outcome.result, outcome.text)
