"""What is to be said of drives now: what changed, at most once a second, and all of it each half minute.

What a drive said too long ago is not shown as what it says: it is gone then, as if it did not answer. Time is an
argument here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from drivebus.sinks.mqtt_drives import MqttDrive
from drivebus.sinks.mqtt_messages import Message, moment, packed, plain
from drivebus.sinks.mqtt_topics import Topics
from drivebus.sinks.picture import DrivePicture, Picture

__all__ = ["OFFLINE", "ONLINE", "REPEATS", "Due", "Present"]

ONLINE, OFFLINE = b"online", b"offline"
REPEATS = 30.0
"""Seconds after which a state is said again that did not change."""
_PAUSE = 1.0
"""Seconds between two states of one drive."""


class Due(NamedTuple):
    """What is to be said of one drive.

    Attributes:
        drive: Its name.
        messages: What.
        told: What that is, but for how old it is.
    """

    drive: str
    messages: tuple[Message, ...]
    told: object


class _Said(NamedTuple):
    at: float
    told: object


class Present:
    """What a broker was told of drives.

    Args:
        drives: Those that are polled, and others.
        topics: Where it is told.
    """

    def __init__(self, drives: Sequence[MqttDrive], topics: Topics) -> None:
        self._drives = [each for each in drives if each.fresh]
        self._topics = topics
        self._said: dict[str, _Said] = {}

    def forget(self) -> None:
        """Nobody was told anything: the broker is another one, or forgot it all."""
        self._said.clear()

    def due(self, picture: Picture, now: float) -> Iterator[Due]:
        """What of *picture* is to be said at the moment *now*, in seconds of a clock that only goes forward."""
        there: dict[str, list[DrivePicture]] = {}
        for line in picture.lines:
            for drive in line.drives:
                there.setdefault(drive.layout.drive, []).append(drive)
        for known in self._drives:
            told, at, is_good = _state(known, there.get(known.name, []), picture.time)
            said = self._said.get(known.name)
            since = REPEATS if said is None else now - said.at
            if since < (REPEATS if said is not None and said.told == told else _PAUSE):
                continue
            age = {} if at is None else {"time": moment(at), "age": round(max(picture.time - at, 0.0), 3)}
            yield Due(
                known.name,
                (
                    Message(self._topics.of(known.name, "state"), packed({**age, **told}), keeps=True),
                    Message(self._topics.of(known.name, "availability"), ONLINE if is_good else OFFLINE, keeps=True),
                ),
                told,
            )

    def was_said(self, due: Due, now: float) -> None:
        """What was *due* is said."""
        self._said[due.drive] = _Said(now, due.told)


def _state(drive: MqttDrive, polls: Sequence[DrivePicture], now: float) -> tuple[dict[str, Any], float | None, bool]:
    """What *polls* of a drive say, without its time; when that was; and whether it is worth something."""
    polls = sorted(polls, key=lambda each: each.time)
    if not polls:
        return _gone("its line is away, or it was not asked yet"), None, False
    last = polls[-1]
    if last.missing:
        return _gone(last.missing), last.time, False
    # A clock that was set back makes nothing fresh.
    fresh = [each for each in polls if not each.missing and abs(now - each.time) <= drive.fresh.get(each.poll, 0.0)]
    if not fresh:
        return _gone("it was not asked any more"), last.time, False
    values: dict[str, Any] = {}
    times: dict[str, str] = {}
    for each in fresh:
        for name, value in plain(each.layout.names, each.values).items():
            values[name] = value
            times[name] = moment(each.time)
            if each is fresh[-1]:
                del times[name]
    told = {"quality": "good", "state": fresh[-1].state or None, "fault": fresh[-1].fault or None, "values": values}
    # What an earlier poll said is older than the rest, and says so itself.
    return {**told, **({"times": times} if times else {})}, fresh[-1].time, True


def _gone(why: str) -> dict[str, Any]:
    return {"quality": "gone", "missing": why, "state": None, "fault": None, "values": {}}
