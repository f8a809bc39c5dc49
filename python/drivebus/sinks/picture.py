"""How a plant is now: its lines, what its drives said last, and who asks. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from drivebus.spool import Layout
from drivebus.values import Value

__all__ = ["DrivePicture", "GatewayPicture", "LinePicture", "Picture"]


@dataclass(frozen=True)
class DrivePicture:
    """What a drive said last, in one poll.

    Attributes:
        poll: Which poll it was, as they stand in the file, from 1.
        layout: Which drive, and what it was asked.
        time: Unix time in seconds at which it was asked.
        missing: Why there are no values, in words; empty where there are.
        values: One for each name of the layout.
        state: What it is doing, in words; empty where its family has no word for that, or it did not answer.
        fault: The fault that it is in, in words; empty where it is in none, or that cannot be told.
        interval: Seconds from one sample to the next.
    """

    poll: int
    layout: Layout
    time: float
    missing: str
    values: tuple[Value, ...]
    state: str = ""
    fault: str = ""
    interval: float = 1.0


@dataclass(frozen=True)
class GatewayPicture:
    """What became of the requests at one gateway since its line was opened.

    Attributes:
        address: Where it is.
        clients: Connections that are open.
        requests: How many there were of each outcome.
    """

    address: str
    clients: int
    requests: Mapping[str, int]


@dataclass(frozen=True)
class LinePicture:
    """A line.

    Attributes:
        name: What it is called.
        open: Whether its port is open.
        counts: What was counted since it was opened, by the names of `drivebus.Stats`; empty where it is not open.
        drives: What each drive that is polled said last.
        gateways: Who asks over the network.
        hints: What the counters most likely mean, and what to do, in words.
        why: Why its port is not open, in words; empty where it is.
    """

    name: str
    open: bool
    counts: Mapping[str, float]
    drives: tuple[DrivePicture, ...] = ()
    gateways: tuple[GatewayPicture, ...] = ()
    hints: tuple[str, ...] = ()
    why: str = ""


@dataclass(frozen=True)
class Picture:
    """A plant.

    Attributes:
        time: Unix time in seconds.
        lines: Its lines.
        spooled: Samples that were kept since its service began; `lost`: those that gave way.
    """

    time: float
    lines: tuple[LinePicture, ...]
    spooled: int = 0
    lost: int = 0
