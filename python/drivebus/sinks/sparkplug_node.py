"""An edge node of Sparkplug B, with drives as its devices: which messages tell a host what is, in which order.

Nothing is sent here. Source: Eclipse Sparkplug Specification 3.0.0, chapters 4 (topics), 5 (operational behavior) and
6.4.17 to 6.4.26 (what each message has).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from drivebus.sinks.picture import DrivePicture, Picture
from drivebus.sinks.sparkplug_payload import Metric, Payload, PayloadError
from drivebus.spool import Layout, Spooled
from drivebus.values import Value

__all__ = ["NAMESPACE", "Message", "Node", "wants_rebirth"]

NAMESPACE = "spBv1.0"
REBIRTH, BD_SEQ, EVENT = "Node Control/Rebirth", "bdSeq", "event"
_NUMBERS = 256
"""`seq` and `bdSeq` begin again behind 255."""
_JUST_BEFORE = 5.0
"""Seconds before a birth within which a sample was measured that the birth has told already."""


class Message(NamedTuple):
    """One message.

    Attributes:
        topic: Where to.
        payload: What.
    """

    topic: str
    payload: bytes


@dataclass
class _Device:
    """What a host knows of one drive.

    Attributes:
        names: Of the metrics that its birth has, with their units and types.
        last: What each was told to be last, and when that was measured, in milliseconds.
        is_alive: Whether it is born.
        seq: The number of the sample that was told last as present.
        time: When that was measured.
    """

    names: dict[str, tuple[str, type]] = field(default_factory=dict)
    last: dict[str, tuple[Value, int]] = field(default_factory=dict)
    is_alive: bool = False
    seq: int = 0
    time: float = float("-inf")


class Node:
    """One session after another of an edge node: what a host is told, and what it knows then.

    Args:
        group: Its group.
        name: Its own name in the group. Neither has "/", "+" or "#".
        clock: Unix time in seconds.
    """

    def __init__(self, group: str, name: str, clock: Callable[[], float]) -> None:
        self._group = group
        self._name = name
        self._clock = clock
        self._bd_seq = 0
        self._seq = 0
        self._head = 0
        self._devices: dict[str, _Device] = {}

    def topic(self, kind: str, device: str = "") -> str:
        """The topic of messages of one *kind*, of the node or of a *device*."""
        return "/".join(filter(None, (NAMESPACE, self._group, kind, self._name, device)))

    def death(self, bd_seq: int) -> Message:
        """What is left with the broker before a session begins, and ends it: *bd_seq* is its number."""
        self._bd_seq = bd_seq % _NUMBERS
        return Message(self.topic("NDEATH"), Payload(self._now(), [self._session()], None).packed())

    def birth(self, picture: Picture, head: int) -> list[Message]:
        """A session begins, or its host wants to hear all anew: the node, and each drive that answers in *picture*.

        Samples up to number *head* are the past from now on.
        """
        self._seq = -1
        self._head = head
        now = self._now()
        metrics = [self._session(), Metric(REBIRTH, False, now), Metric(EVENT, None, now, kind=str)]
        told = [self._message("NBIRTH", metrics)]
        for device in self._devices.values():
            device.is_alive = False
            device.last.clear()
        for name, said in _by_drive(picture).items():
            device = self._devices.setdefault(name, _Device())
            last = max(said, key=lambda each: each.time)
            if last.missing:
                continue
            device.time = last.time
            for each in said:
                _learn(device, each.layout)
                _take(device, each.layout, each.values, each.time)
            told.append(self._born(name, device))
        return told

    def data(self, samples: Sequence[Spooled]) -> list[Message]:
        """What tells a host of *samples*, which are in their order."""
        told: list[Message] = []
        woken: list[str] = []
        for sample in samples:
            if sample.layout.event:
                is_old = sample.seq <= self._head
                text = f"{sample.layout.drive}: {sample.missing}" if sample.layout.drive else sample.missing
                told.append(self._message("NDATA", [Metric(EVENT, text, _milliseconds(sample.time), is_old)]))
            else:
                told.extend(self._of_drive(sample, woken))
        # Who was born only so that its past could be told is not there now, as far as is known.
        told.extend(self._dead(name) for name in woken if self._devices[name].is_alive)
        return told

    def _of_drive(self, sample: Spooled, woken: list[str]) -> Iterator[Message]:
        name = sample.layout.drive
        device = self._devices.setdefault(name, _Device())
        is_old = sample.seq <= max(self._head, device.seq) or 0.0 <= device.time - sample.time < _JUST_BEFORE
        if not is_old:
            device.seq, device.time = sample.seq, sample.time
            if name in woken:
                woken.remove(name)
                if device.is_alive:
                    yield self._dead(name)
        if sample.missing:
            if not is_old and device.is_alive:
                yield self._dead(name)
            return
        is_new = _learn(device, sample.layout)
        if not is_old:
            _take(device, sample.layout, sample.values, sample.time)
            if is_new or not device.is_alive:
                yield self._born(name, device)
                return
        elif is_new or not device.is_alive:
            if not device.is_alive:
                woken.append(name)
            yield self._born(name, device)
        at = _milliseconds(sample.time)
        values = zip(sample.layout.names, sample.values, strict=False)
        metrics = [Metric(each, _typed(value, device.names[each][1]), at, is_old) for each, value in values]
        yield self._message("DDATA", metrics, name)

    def _born(self, name: str, device: _Device) -> Message:
        device.is_alive = True
        metrics: list[Metric] = []
        for each, (unit, kind) in device.names.items():
            value, at = device.last.get(each, (None, self._now()))
            metrics.append(Metric(each, None if value is None else _typed(value, kind), at, unit=unit, kind=kind))
        return self._message("DBIRTH", metrics, name)

    def _dead(self, name: str) -> Message:
        device = self._devices[name]
        device.is_alive = False
        device.last.clear()
        return self._message("DDEATH", [], name)

    def _session(self) -> Metric:
        return Metric(BD_SEQ, self._bd_seq, self._now())

    def _message(self, kind: str, metrics: Sequence[Metric], device: str = "") -> Message:
        self._seq = (self._seq + 1) % _NUMBERS
        return Message(self.topic(kind, device), Payload(self._now(), metrics, self._seq).packed())

    def _now(self) -> int:
        return _milliseconds(self._clock())


def wants_rebirth(payload: bytes) -> bool:
    """Whether a command to the node asks to hear all anew. What is no payload asks for nothing."""
    try:
        return any(each.name == REBIRTH and each.value is True for each in Payload.read(payload).metrics)
    except PayloadError:
        return False


def _by_drive(picture: Picture) -> dict[str, list[DrivePicture]]:
    found: dict[str, list[DrivePicture]] = {}
    for line in picture.lines:
        for said in line.drives:
            found.setdefault(said.layout.drive, []).append(said)
    return found


def _learn(device: _Device, layout: Layout) -> bool:
    """The metrics of *layout* are among those of *device*; whether one was not."""
    known = len(device.names)
    for name, unit, digits in zip(layout.names, layout.units, layout.digits, strict=False):
        # What a drive counts in whole steps stays whole: its type is in the birth, and holds from there on.
        device.names.setdefault(name, (unit, float if digits else int))
    return len(device.names) > known


def _take(device: _Device, layout: Layout, values: Iterable[Value], time: float) -> None:
    """They are the last that is known of *device*."""
    at = _milliseconds(time)
    device.last.update((name, (value, at)) for name, value in zip(layout.names, values, strict=False))


def _typed(value: Value, kind: type) -> float:
    return float(value) if kind is float else round(value)


def _milliseconds(time: float) -> int:
    # A clock that shows nonsense keeps no sample from being told.
    return int(time * 1_000) if 0.0 <= time < 1e12 else 0
