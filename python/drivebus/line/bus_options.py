"""The keywords of a bus, for calls that hand them on."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TypedDict

__all__ = ["BusOptions"]


class BusOptions(TypedDict, total=False):
    """What a bus is opened with besides its port: the keywords of `settings.BusFace`, for calls that hand them on."""

    baudrate: int
    parity: str
    stopbits: int
    bytesize: int
    silence: str | float
    timeout: float
    retries: int
    read_only: bool
    rs485: Mapping[str, object] | None
    echo: str
    turnaround: float
    learn_timeout: bool
    low_latency: bool
    queue: int
    share: str
    group: str | int | None
    realtime: bool
    reserved: bool
    trace: str | os.PathLike[str] | None
