"""What is said over MQTT, as JSON: samples, events and answers. Text of others is escaped, and no number is NaN."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, timezone
from typing import Any, NamedTuple

from drivebus.spool import Spooled
from drivebus.values import Value

__all__ = ["Message", "batches", "event", "moment", "packed", "plain"]


class Message(NamedTuple):
    """Something to say.

    Attributes:
        topic: Where.
        payload: What.
        keeps: Whether the broker shall keep it for whoever comes later; an empty one ends that.
        to: What the answer to a question is known by, where it was asked for.
    """

    topic: str
    payload: bytes
    keeps: bool = False
    to: bytes | None = None


def moment(at: float) -> str:
    """The Unix time *at* in ISO 8601, UTC, in milliseconds."""
    told = datetime.fromtimestamp(at, timezone.utc).isoformat(timespec="milliseconds")
    return told.removesuffix("+00:00") + "Z"


def packed(told: object) -> bytes:
    """*told* as JSON, in ASCII."""
    return json.dumps(told, separators=(",", ":"), allow_nan=False).encode()


def plain(names: Sequence[str], values: Sequence[Value]) -> dict[str, Value | None]:
    """*values* by *names*. What is no number, or endless, is None."""
    return {name: value if math.isfinite(value) else None for name, value in zip(names, values, strict=False)}


def event(sample: Spooled) -> dict[str, Any]:
    """An event of a spool."""
    return {
        "epoch": sample.epoch,
        "seq": sample.seq,
        "time": moment(sample.time),
        "subject": sample.layout.drive,
        "kind": sample.layout.event,
        "text": sample.missing,
    }


def batches(samples: Sequence[Spooled], largest: int) -> Iterator[bytes]:
    """*samples* as lists, each of *largest* bytes at most; a single one that is larger is a list of its own."""
    parts: list[bytes] = []
    size = 0
    for sample in samples:
        part = packed(_sample(sample))
        if parts and size + len(part) + 2 > largest:
            yield b"[" + b",".join(parts) + b"]"
            parts, size = [], 0
        parts.append(part)
        size += len(part) + 1
    if parts:
        yield b"[" + b",".join(parts) + b"]"


def _sample(sample: Spooled) -> Mapping[str, Any]:
    told: dict[str, Any] = {
        "epoch": sample.epoch,
        "seq": sample.seq,
        "time": moment(sample.time),
        "took": round(sample.took, 6),
        "drive": sample.layout.drive,
    }
    if sample.missing:
        return {**told, "missing": sample.missing}
    return {**told, "values": plain(sample.layout.names, sample.values)}
