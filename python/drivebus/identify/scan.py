"""A scan of a line: which units are asked, how long each is given, and what is told of one that answers.

It asks with the settings that the line has. Other speeds and formats are tried by `searching`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from drivebus import checks
from drivebus.errors import BadAnswer, NoAnswer, NotAllowed
from drivebus.identify.choose import usable
from drivebus.identify.identify import Read, identify
from drivebus.identify.results import Found
from drivebus.line import huanyang
from drivebus.line.frames import frames_in, may_be_of

__all__ = ["look_for", "time_for", "units"]

_TIMEOUT = 0.1
"""Seconds a unit is given in a scan: over ten times the factory response delay, and 247 units in half a minute."""


def units(given: Iterable[int]) -> list[int]:
    """The units of a scan."""
    if not isinstance(given, Iterable):
        raise NotAllowed(f"units is {checks.shown(given)}; give addresses from 1 to 247, such as range(1, 248) or [5]")
    return [checks.unit(unit) for unit in given]


def time_for(timeout: float | None, of_bus: float) -> float:
    """Seconds each unit is given in a scan: *timeout*, or if that is None no more than the time-out *of_bus*."""
    limit = min(_TIMEOUT, of_bus) if timeout is None else timeout
    return checks.number("timeout", limit, 0.0, 3600.0, above=True)


async def look_for(read: Read, now: Callable[[], float], unit: int) -> Found | None:
    """Who answers at *unit*, if somebody does. *read* asks for one word, once; *now* tells the time in seconds."""
    started = now()
    took: list[float] = []

    async def timed(unit: int, address: int, **table: str) -> list[int]:
        try:
            return await read(unit, address, **table)
        finally:
            took.append(now() - started)

    try:
        found = await identify(timed, unit)
    except (NoAnswer, BadAnswer) as error:
        if any(frame[0] == unit and huanyang.is_sure(frame) for frame in frames_in(error.raw)):
            said = f"it speaks {huanyang.NAME}, which is no Modbus: drivebus has no command for it"
            return Found(unit, None, None, took[0], said, protocol="huanyang")
        if isinstance(error, NoAnswer) or not may_be_of(unit, error.raw):
            return None  # silence, noise, or somebody else's
        return Found(unit, None, None, took[0], str(error))
    family = usable(found, unverified=True) or found.family
    problem = found.reason if found.certainty == "unknown" and found.code is None else None
    return Found(unit, family, found.code, took[0], problem, found.certainty, found.candidates)
